"""Bags to tables, held against what ROS's own deserialisation says about the same messages."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import pandas as pd
import pytest
import rosbag
import roslib.message
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, TransformStamped, Vector3, WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan, PointCloud2
from std_msgs.msg import Float64, Float64MultiArray, Header, String
from tf2_msgs.msg import TFMessage

from custom_ros_tools.errors import UnknownNameError
from ros_pybullet_interface.msg import ContactPoint, Contacts
from rpbi_data import bag_to_dataframes

TYPES = [
    "diagnostic_msgs/KeyValue",
    "geometry_msgs/PolygonStamped",
    "geometry_msgs/PoseWithCovarianceStamped",
    "geometry_msgs/TransformStamped",
    "geometry_msgs/WrenchStamped",
    "rosgraph_msgs/Clock",
    "rosgraph_msgs/Log",
    "rosgraph_msgs/TopicStatistics",
    "sensor_msgs/BatteryState",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/Imu",
    "sensor_msgs/Joy",
    "sensor_msgs/LaserScan",
    "sensor_msgs/MultiDOFJointState",
    "sensor_msgs/NavSatFix",
    "sensor_msgs/PointCloud",
    "std_msgs/Bool",
    "std_msgs/ByteMultiArray",
    "std_msgs/Duration",
    "std_msgs/Empty",
    "std_msgs/Float32MultiArray",
    "std_msgs/Int64MultiArray",
    "std_msgs/UInt64",
    "trajectory_msgs/JointTrajectory",
    "trajectory_msgs/MultiDOFJointTrajectory",
    "visualization_msgs/InteractiveMarkerFeedback",
    "visualization_msgs/Marker",
]
INTEGERS = {f"{sign}int{bits}": (0 if sign else -(2 ** (bits - 1)), 2 ** (bits if sign else bits - 1) - 1)
            for sign in ("", "u") for bits in (8, 16, 32, 64)}  # fmt: skip
INTEGERS |= {"byte": INTEGERS["int8"], "char": INTEGERS["uint8"]}


def _fill(message: genpy.Message, chance: random.Random) -> genpy.Message:
    """Gives every field a random value, and every variable-length array a random length."""
    for name, slot_type in zip(message.__slots__, message._slot_types, strict=True):
        base, _, length = slot_type.partition("[")
        if length:
            count = int(length[:-1]) if length != "]" else chance.choice([0, 0, 1, 2, 3])
            values = [_value(base, chance) for _ in range(count)]
            setattr(message, name, bytes(values) if base in ("uint8", "char") else values)
        else:
            setattr(message, name, _value(base, chance))
    return message


def _value(kind: str, chance: random.Random) -> Any:
    if kind in INTEGERS:
        return chance.choice([*INTEGERS[kind], chance.randint(*INTEGERS[kind])])
    if kind == "bool":
        return chance.random() < 0.5
    if kind == "float32":
        return struct.unpack("f", struct.pack("f", chance.gauss(0, 1e3)))[0]
    if kind == "float64":
        return chance.choice([chance.gauss(0, 1e3), math.inf, math.nan, -0.0])
    if kind == "string":
        return chance.choice(["", "a", "b", "ä", "two words\n"])
    if kind == "time":
        return genpy.Time(chance.choice([0, 0, chance.randint(1, 2**32 - 1)]), 0)
    if kind == "duration":
        return genpy.Duration(chance.randint(-100, 100), chance.randint(0, 999_999_999))
    return _fill(roslib.message.get_message_class(kind)(), chance)


def _flatten(message: genpy.Message, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yields column and value of every field: what a table has to say about a message, the slow way."""
    for name, slot_type in zip(message.__slots__, message._slot_types, strict=True):
        value = getattr(message, name)
        if slot_type in ("uint8[]", "char[]"):
            yield prefix + name, bytes(value)
            continue
        elements = enumerate(value) if slot_type.endswith("]") else [(None, value)]
        for index, element in elements:
            path = prefix + name if index is None else f"{prefix}{name}/{index}"
            if isinstance(element, genpy.Message):
                yield from _flatten(element, path + "/")
            else:
                yield path, element.to_sec() if isinstance(element, genpy.rostime.TVal) else element


def _is_same(cell: Any, expected: Any) -> bool:
    if isinstance(cell, float):  # also integers of which some are missing
        return bool(np.array_equal(cell, float(expected), equal_nan=True))
    return bool(cell == expected)


@pytest.mark.quick
@pytest.mark.parametrize("type_name", TYPES)
def test_tables_contain_the_values_of_the_messages(type_name: str, write_bag: Callable[..., Path]) -> None:
    message_class = roslib.message.get_message_class(type_name)
    chance = random.Random(type_name)
    path = write_bag(("/topic", _fill(message_class(), chance)) for _ in range(60))
    table = bag_to_dataframes(path, "/topic")["/topic"].sort_values("record_time")
    with rosbag.Bag(str(path)) as bag:
        messages = [(message, time.to_sec()) for _, message, time in bag.read_messages()]
    assert len(table) == len(messages) == 60
    columns = {"record_time"}
    for (message, record_time), index, row in zip(messages, table.index, table.to_dict("records"), strict=True):
        expected = dict(_flatten(message))
        stamp = expected.pop("header/stamp", 0.0)
        assert index == (stamp or record_time)
        assert row.pop("record_time") == record_time
        columns |= set(expected)
        cells = {name: (row.pop(name), value) for name, value in expected.items()}
        assert not {name: pair for name, pair in cells.items() if not _is_same(*pair)}
        assert pd.isna(list(row.values())).all()  # what this message does not have
    assert set(table.columns) == columns


def _joint_state(stamp_s: float, **positions: float) -> JointState:
    header = Header(stamp=genpy.Time.from_sec(stamp_s))
    names = list(positions)
    return JointState(header=header, name=names, position=list(positions.values()), effort=[-1.0] * len(names))


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_joint_states_are_columns_by_name_for_any_compression(compression: str, write_bag: Callable[..., Path]) -> None:
    states = [_joint_state(1 + index / 1000, b=index, a=-index) for index in range(500)]
    table = bag_to_dataframes(write_bag((("/states", state) for state in states), compression=compression))["/states"]
    assert list(table.columns[1:]) == [
        "header/seq", "header/frame_id", "position/b", "position/a", "effort/b", "effort/a"
    ]  # fmt: skip
    np.testing.assert_array_equal(table["position/a"], -np.arange(500.0))
    np.testing.assert_array_equal(table["position/b"], np.arange(500.0))
    np.testing.assert_array_equal(table.index, [state.header.stamp.to_sec() for state in states])


def test_partial_targets_leave_gaps_where_a_joint_is_not_named(write_bag: Callable[..., Path]) -> None:
    targets = [_joint_state(1, a=1.0, b=2.0), _joint_state(2, b=3.0), _joint_state(3, c=4.0, a=5.0)]
    table = bag_to_dataframes(write_bag(("/target", target) for target in targets))["/target"]
    nan = math.nan
    np.testing.assert_array_equal(
        table[["position/a", "position/b", "position/c"]], [[1.0, 2.0, nan], [nan, 3.0, nan], [5.0, nan, 4.0]]
    )
    assert not any(name.startswith("velocity/") for name in table.columns)


def test_transforms_are_rows(write_bag: Callable[..., Path]) -> None:
    def transform(stamp_s: int, child: str, x: float) -> TransformStamped:
        message = TransformStamped(child_frame_id=child)
        message.header = Header(stamp=genpy.Time(stamp_s), frame_id="rpbi/world")
        message.transform.translation = Vector3(x, 0.0, 0.0)
        message.transform.rotation.w = 1.0
        return message

    first = TFMessage([transform(7, "a", 1.0), transform(7, "b", 2.0)])
    second = TFMessage([transform(6, "longer", 3.0)])
    static = TFMessage([transform(0, "c", 4.0)])
    tables = bag_to_dataframes(write_bag([("/tf", first), ("/tf", second), ("/tf", TFMessage()), ("/tf", static)]))
    table = tables["/tf"]
    axes = [*(f"translation/{axis}" for axis in "xyz"), *(f"rotation/{axis}" for axis in "xyzw")]
    assert list(table.columns) == ["record_time", "parent", "child", *axes]
    assert list(table["child"]) == ["longer", "a", "b", "c"]
    assert list(table["translation/x"]) == [3.0, 1.0, 2.0, 4.0]
    assert list(table.index) == [6.0, 7.0, 7.0, 100.003]
    assert set(table["parent"]) == {"rpbi/world"}


def test_diagnostics_are_rows_with_columns_by_key(write_bag: Callable[..., Path]) -> None:
    loop = DiagnosticStatus(name="loop", level=1, values=[KeyValue("overruns", "3"), KeyValue("factor", "0.99")])
    camera = DiagnosticStatus(name="camera", message="fine", values=[KeyValue("factor", "")])
    message = DiagnosticArray(Header(stamp=genpy.Time(5)), [loop, camera])
    table = bag_to_dataframes(write_bag([("/diagnostics", message)]))["/diagnostics"]
    assert list(table.index) == [5.0, 5.0]
    assert list(table["name"]) == ["loop", "camera"]
    assert list(table["level"]) == [1, 0]
    assert list(table["values/factor"]) == ["0.99", ""]
    assert list(table["values/overruns"]) == ["3", None]


def test_contacts_are_rows_and_times_without_contact_are_seen(write_bag: Callable[..., Path]) -> None:
    floor = ContactPoint(link="link0", other_body="floor", position=Point(0.1, 0.2, 0.0), normal_force=8.0)
    arm = ContactPoint(link="link0", other_body="arm", position=Point(0.3, 0.2, 0.1), normal_force=5.0)
    headers = [Header(stamp=genpy.Time(second), frame_id="rpbi/world") for second in (1, 2, 3)]
    touching = Contacts(headers[1], Vector3(5.0, 0.0, 8.0), [floor, arm])
    messages = [Contacts(headers[0], Vector3(), []), touching, Contacts(headers[2], Vector3(0.0, 0.0, 8.0), [floor])]
    table = bag_to_dataframes(write_bag(("/contacts", message) for message in messages))["/contacts"]
    assert list(table.index) == [1.0, 2.0, 2.0, 3.0]
    assert list(table["other_body"]) == [None, "floor", "arm", "floor"]
    assert list(table["force/z"]) == [0.0, 8.0, 8.0, 8.0]
    assert list(table["position/x"].iloc[1:]) == [0.1, 0.3, 0.1] and math.isnan(table["position/x"].iloc[0])
    assert list(table["normal_force"].groupby(level="time").sum()) == [0.0, 13.0, 8.0]
    assert table.shape[1] == 1 + 2 + 3 + 19, "record_time, header, sum, and the fields of a point"


def test_topics_without_header_are_indexed_by_the_time_of_recording(write_bag: Callable[..., Path]) -> None:
    tables = bag_to_dataframes(
        write_bag([("/clock", Clock(genpy.Time(3, 500_000_000))), ("/target", Float64MultiArray(data=[1.0, 2.0]))])
    )
    assert list(tables["/clock"].index) == [100.0]
    assert list(tables["/clock"]["clock"]) == [3.5]
    assert list(tables["/target"].index) == [100.001]
    assert list(tables["/target"][["data/0", "data/1"]].iloc[0]) == [1.0, 2.0]


def test_topics_can_be_joined_by_their_stamps(write_bag: Callable[..., Path]) -> None:
    messages = []
    for index in range(20):
        wrench = WrenchStamped(header=Header(stamp=genpy.Time(1_700_000_000, index * 12_345_678)))
        wrench.wrench.force.z = index
        messages.append(("/wrench", wrench))
        messages.append(("/states", JointState(header=wrench.header, name=["a"], position=[index])))
    tables = bag_to_dataframes(write_bag(messages))
    joined = tables["/states"].join(tables["/wrench"], rsuffix="_wrench", how="inner")
    assert len(joined) == 20
    assert (joined["position/a"] == joined["wrench/force/z"]).all()


def _pictures() -> list[tuple[str, Any]]:
    image = Image(height=1, width=2, encoding="rgb8", step=6, data=b"\0\1\2\3\4\0")
    return [
        ("/image", image),
        ("/cloud", PointCloud2(data=b"\1\2")),
        ("/info", CameraInfo(K=range(9), D=[0.5])),
    ]


def test_images_and_clouds_are_left_out_unless_asked_for(write_bag: Callable[..., Path]) -> None:
    path = write_bag(_pictures())
    assert list(bag_to_dataframes(path)) == ["/info"]
    assert list(bag_to_dataframes(path, images=True)) == ["/cloud", "/image", "/info"]
    for table in (
        bag_to_dataframes(path, ["/image"])["/image"],
        bag_to_dataframes(path, images=True)["/image"],
    ):
        assert table["data"].iloc[0] == b"\0\1\2\3\4\0"
        assert table["encoding"].iloc[0] == "rgb8"


def test_camera_info_has_its_matrices_in_columns(write_bag: Callable[..., Path]) -> None:
    table = bag_to_dataframes(write_bag(_pictures()))["/info"]
    assert list(table[[f"K/{index}" for index in range(9)]].iloc[0]) == list(range(9))
    assert table["D/0"].iloc[0] == 0.5
    assert "P/11" in table.columns


def test_long_arrays_become_bytes_when_asked_for(
    write_bag: Callable[..., Path], caplog: pytest.LogCaptureFixture
) -> None:
    path = write_bag([("/scan", LaserScan(ranges=[0.5] * 2000)), ("/scan", LaserScan(ranges=[0.5] * 2))])
    table = bag_to_dataframes(path)["/scan"]
    assert list(table["ranges/1"].isna()) == [True, False]
    assert "ranges" not in table.columns
    assert "'ranges' is binary or long: left out" in caplog.text
    cell = bag_to_dataframes(path, "/scan")["/scan"]["ranges"].iloc[0]
    np.testing.assert_array_equal(np.frombuffer(cell, np.float32), [0.5] * 2000)


def test_only_the_named_topics_are_read_once_in_any_order(write_bag: Callable[..., Path]) -> None:
    path = write_bag([("/a", Float64(1.0)), ("/b", Float64(2.0)), ("/c", String("x"))])
    assert list(bag_to_dataframes(path, ["/c", "/a", "/c"])) == ["/a", "/c"]
    assert list(bag_to_dataframes(path, "/b")) == ["/b"]
    assert bag_to_dataframes(path, []) == {}


def test_an_unknown_topic_is_named_with_those_there_are(write_bag: Callable[..., Path]) -> None:
    path = write_bag([("/states", Float64(1.0)), ("/wrench", Float64(1.0))])
    with pytest.raises(UnknownNameError, match="unknown topic '/state'.*did you mean '/states'"):
        bag_to_dataframes(path, ["/wrench", "/state"])


def test_an_empty_bag_gives_no_tables(write_bag: Callable[..., Path]) -> None:
    assert bag_to_dataframes(write_bag([])) == {}


def test_progress_is_shown_if_it_is_asked_for(
    write_bag: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_bag([("/a", Float64(1.0))] * 2500 + _pictures())
    bag_to_dataframes(path)
    assert capsys.readouterr().err == ""
    bag_to_dataframes(path, progress=True)
    assert "messages" in capsys.readouterr().err


def test_a_bag_with_an_own_type_needs_no_installed_class(tmp_path: Path) -> None:
    own = genpy.dynamic.generate_dynamic("unheard_msgs/Of", "float64 x\nstring text\n")["unheard_msgs/Of"]
    path = tmp_path / "own.bag"
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/own", own(x=1.5, text="hello"), genpy.Time(1))
    row = bag_to_dataframes(path)["/own"].iloc[0]
    assert (row["x"], row["text"]) == (1.5, "hello")


def test_reading_needs_neither_master_nor_node(write_bag: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_bag([("/a", Float64(1.0))])
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    pd.testing.assert_series_equal(
        bag_to_dataframes(path)["/a"]["data"], pd.Series([1.0], pd.Index([100.0], name="time"), name="data")
    )
