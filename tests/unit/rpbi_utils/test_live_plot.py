"""Fields of messages by name, and lines that grow."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np
import pytest

from rpbi_data.bags.message_layout import MessageType
from rpbi_utils.live_plot.fields import FieldError, FieldReader, split_name
from rpbi_utils.live_plot.plot import MAX_SAMPLES, Line, LivePlot, thinned, ticks

TOPICS = {"/arm/joint_states", "/arm/joint_states/target", "/armature"}
LEFT, RIGHT = ["left", "right"], [1.0, 2.0]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("/arm/joint_states/position[0]", ("/arm/joint_states", "position/0")),
        ("/arm/joint_states/position/left", ("/arm/joint_states", "position/left")),
        ("/arm/joint_states/target/position[12]", ("/arm/joint_states/target", "position/12")),
        ("/armature/points[3]/x", ("/armature", "points/3/x")),
        ("/armature", ("/armature", "")),
        ("/ar/position", None),
        ("/joint_states/position[0]", None),
    ],
)
def test_names_are_split_at_the_longest_topic(name: str, expected: tuple[str, str] | None) -> None:
    assert split_name(name, TOPICS) == expected


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("position/1", {"position/1": 2.0}),
        ("position/right", {"position/right": 2.0}),
        ("position", {"position/left": 1.0, "position/right": 2.0}),
        ("", {"position/left": 1.0, "position/right": 2.0, "effort/left": 5.0, "effort/right": 6.0}),
        ("header/seq", {"header/seq": 0.0}),
        ("velocity", {}),
        ("velocity/0", {}),
    ],
)
def test_joint_states_are_read_by_index_and_by_name(
    joint_state_type: MessageType, pack_joint_state: Callable[..., bytes], path: str, expected: dict[str, float]
) -> None:
    values = FieldReader("/arm", path).read(joint_state_type, pack_joint_state(7, LEFT, RIGHT, (), (5.0, 6.0)))
    assert values.by_name == expected and values.stamp_s == 7.0


def test_a_joint_is_found_again_where_the_order_changes(
    joint_state_type: MessageType, pack_joint_state: Callable[..., bytes]
) -> None:
    reader = FieldReader("/arm", "position/right")
    assert reader.read(joint_state_type, pack_joint_state(0, LEFT, RIGHT)).by_name == {"position/right": 2.0}
    again = reader.read(joint_state_type, pack_joint_state(0, ["after", "right"], [3.0, 4.0]))
    assert (again.by_name, again.stamp_s) == ({"position/right": 4.0}, None)
    longer = reader.read(joint_state_type, pack_joint_state(0, ["right", "left", "x"], [5.0, 6.0, 7.0]))
    assert longer.by_name == {"position/right": 5.0}


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("positon/0", "unknown field 'positon/0'; did you mean 'position/0'?"),
        ("zzz", "unknown field 'zzz'; known are header/seq, header/stamp, position/left, "),
        ("name/0", "expected a number, 'name/0' is text"),
        ("position/middle", "unknown field 'position/middle'"),
    ],
)
def test_wrong_fields_are_named_in_one_line(
    joint_state_type: MessageType, pack_joint_state: Callable[..., bytes], path: str, words: str
) -> None:
    with pytest.raises(FieldError) as caught:
        FieldReader("/arm", path).read(joint_state_type, pack_joint_state(0, LEFT, RIGHT))
    assert str(caught.value).startswith(f"/arm (sensor_msgs/JointState): {words}")
    assert "\n" not in str(caught.value)


def test_a_message_without_numbers_is_refused() -> None:
    text = MessageType.parse("std_msgs/String", "string data\n")
    with pytest.raises(FieldError, match="expected numbers, there are none in it"):
        FieldReader("/text", "").read(text, struct.pack("<I", 1) + b"a")


def test_too_many_numbers_are_refused() -> None:
    many = MessageType.parse("test/Many", "float64[] data\n")
    raw = struct.pack("<I17d", 17, *range(17))
    assert FieldReader("/many", "data/16").read(many, raw).by_name == {"data/16": 16.0}
    with pytest.raises(FieldError, match="'data' has 17 numbers: expected at most 16"):
        FieldReader("/many", "data").read(many, raw)


def test_times_and_small_integers_are_numbers() -> None:
    mixed = MessageType.parse("test/Mixed", "duration left\nint8 small\nbool is_on\n")
    raw = struct.pack("<iibB", 2, 500_000_000, -3, 1)
    assert FieldReader("/mixed", "").read(mixed, raw).by_name == {"left": 2.5, "small": -3.0, "is_on": 1.0}


def test_lines_keep_the_newest_samples_in_order_of_rank() -> None:
    plot = LivePlot()
    for number in range(2 * MAX_SAMPLES + 10):
        plot.add("second", 0.001 * number, float(number), 1)
    plot.add("first", 0.0, 1.0, 0)  # far too late for time to begin anew only by a second
    end_s, lines = plot.view(5.0)
    assert [line.name for line in lines] == ["first"] and end_s == 0.0
    plot.add("first", 0.5, 2.0, 0)
    plot.add("second", 1.0, 3.0, 1)
    plot.add("second", 0.9, 4.0, 1)  # late, dropped
    plot.note("third", "nobody publishes it")
    end_s, lines = plot.view(0.2)
    assert [(line.name, line.note) for line in lines] == [
        ("third", "nobody publishes it"),
        ("first", ""),
        ("second", ""),
    ]
    assert list(lines[1].values) == [2.0] and list(lines[2].values) == [3.0] and end_s == 1.0
    plot.clear()
    assert [line.name for line in plot.view(1.0)[1]] == ["third"]


def test_the_oldest_samples_go_first() -> None:
    plot = LivePlot()
    for number in range(2 * MAX_SAMPLES + 10):
        plot.add("line", 0.001 * number, float(number))
    (line,) = plot.view(1e6)[1]
    assert line.values[-1] == 2 * MAX_SAMPLES + 9 and MAX_SAMPLES <= len(line.values) < 2 * MAX_SAMPLES
    assert (np.diff(line.values) == 1.0).all()
    (line,) = plot.view(1.0)[1]
    assert len(line.values) == pytest.approx(1001, abs=2)


def test_thinned_lines_keep_their_extremes() -> None:
    times = np.linspace(0.0, 10.0, 10_001)
    values = np.sin(times)
    values[5003] = 7.0
    values[7001] = -7.0
    places, heights = thinned(times, values, 0.0, 10.0, 200)
    assert len(places) <= 2 * 201 and (np.diff(places) >= 0).all()
    assert heights.max() == 7.0 and heights.min() == -7.0
    assert places[np.argmax(heights)] == pytest.approx(100.0, abs=1.0)
    same, all_of_it = thinned(times[:300], values[:300], 0.0, 10.0, 200)
    assert len(same) == 300 and (all_of_it == values[:300]).all()


@pytest.mark.parametrize(
    ("low", "high", "count", "expected", "digits"),
    [
        (0.0, 10.0, 5, [0, 2, 4, 6, 8, 10], 0),
        (-0.31, 0.3, 4, [-0.2, 0.0, 0.2], 1),
        (1e5, 3.1e5, 2, [2e5], 0),
        (0.0, 0.04, 4, [0.0, 0.01, 0.02, 0.03, 0.04], 2),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, count: int, expected: list[float], digits: int) -> None:
    found, decimals = ticks(low, high, count)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert decimals == digits


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("/rpbi/arm/joint_states/position[0]", "rad or m"),
        ("/rpbi/arm/joint_states/velocity/elbow", "rad/s or m/s"),
        ("/rpbi/arm/joint_states/effort/force", "N m or N"),
        ("/rpbi/arm/hand/ft_sensor/wrench/torque/x", "N m"),
        ("/rpbi/box/base_state/pose/pose/position/z", "m"),
        ("/rpbi/box/base_state/twist/twist/angular/z", "rad/s"),
        ("/rpbi/box/contacts/contacts[0]/normal_force", "N"),
        ("/probe/later", ""),
    ],
)
def test_units_follow_from_the_fields(name, unit):
    assert Line(name, np.empty(0), np.empty(0), "").unit == unit
