"""What may be wrong with a device of axes and buttons: what can be known is named, and nothing wrong passes."""

from __future__ import annotations

import logging
import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from custom_ros_tools.schema import ConfigModel
from operator_node.device import Device, DeviceError, Reading
from operator_node.devices import spacenav
from operator_node.devices.device_feed import AT_REST, HELD_S, MAX_REASONS, DeviceFeed, FeedConfig, problem_of

READINGS = 40


class NoConfig(ConfigModel):
    """Nothing to set."""


class Gamepad(Device):
    """A stick, a trigger, which rests at 1, and buttons; it says what is on a list, and raises what is an exception."""

    Config = NoConfig
    axes = ("x", "y", "trigger")
    buttons = ("a", "b")

    def __init__(self, says: list[Any]) -> None:
        self.says = says[::-1]

    def open(self) -> None:
        pass

    def read(self, timeout_s: float) -> Any:
        if not self.says:
            return None
        said = self.says.pop()
        if isinstance(said, Exception):
            raise said
        return said

    def close(self) -> None:
        pass

    def at_rest(self) -> Reading:
        return Reading((0.0, 0.0, 1.0), (0, 0))


def moved(generator: random.Random) -> list[Reading]:
    """Returns what a sound one says: from rest on, by steps that a hand makes."""
    said, axes = [Reading((0.0, 0.0, 1.0), (0, 0))], [0.0, 0.0, 1.0]
    for _ in range(READINGS):
        axes = [max(-1.0, min(1.0, value + generator.uniform(-AT_REST, AT_REST))) for value in axes]
        said.append(Reading(tuple(axes), (generator.randint(0, 1), generator.randint(0, 1))))
    return said


def one_axis(change: Callable[[float], Any]) -> Callable[[Reading, int], Reading]:
    """Returns what spoils one axis of a reading; the other axes are good."""

    def spoil(reading: Reading, which: int) -> Reading:
        axes: list[Any] = [*reading.axes]
        axes[which % 3] = change(axes[which % 3] or 0.5)
        return reading._replace(axes=tuple(axes))

    return spoil


def one_button(value: Any) -> Callable[[Reading, int], Reading]:
    """Returns what spoils one button of a reading."""

    def spoil(reading: Reading, which: int) -> Reading:
        buttons: list[Any] = [*reading.buttons]
        buttons[which % 2] = value
        return reading._replace(buttons=tuple(buttons))

    return spoil


NOT_FINITE, OUTSIDE, NO_BUTTON = "is not a finite number", "is outside [-1, 1]", "is neither 0 nor 1"
FAULTS: dict[str, tuple[Callable[[Reading, int], Any], str]] = {
    "NaN": (one_axis(lambda _: math.nan), NOT_FINITE),
    "infinity": (one_axis(lambda value: math.copysign(math.inf, value)), NOT_FINITE),
    "nothing": (one_axis(lambda _: None), NOT_FINITE),
    "text": (one_axis(str), NOT_FINITE),
    "a complex number": (one_axis(lambda value: complex(value, value)), NOT_FINITE),
    "an array for a number": (one_axis(lambda value: np.full(2, value)), NOT_FINITE),
    "mm for m": (one_axis(lambda value: 1000.0 * math.copysign(max(abs(value), 0.01), value)), OUTSIDE),
    "counts for shares": (one_axis(lambda value: round(math.copysign(350, value))), OUTSIDE),
    "full scale too small": (one_axis(lambda value: math.copysign(1.0001, value)), OUTSIDE),
    "unsigned for signed": (one_axis(lambda value: 65536 - round(100 * abs(value))), OUTSIDE),
    "a number beyond floats": (one_axis(lambda _: 10**400), OUTSIDE),
    "an axis less": (lambda reading, which: reading._replace(axes=reading.axes[:-1]), "number of axes"),
    "an axis more": (lambda reading, which: reading._replace(axes=(*reading.axes, 0.0)), "number of axes"),
    "a button less": (lambda reading, which: reading._replace(buttons=(1,)), "number of buttons"),
    "buttons as bits": (one_button(4), NO_BUTTON),
    "a button half pressed": (one_button(0.5), NO_BUTTON),
    "a button that is NaN": (one_button(math.nan), NO_BUTTON),
    "a button as text": (one_button("1"), NO_BUTTON),
    "no reading": (lambda reading, which: (0.1, which), "other than a reading"),
    "an error": (lambda reading, which: ZeroDivisionError("division by zero"), "it failed: ZeroDivisionError"),
}


def played(device: Gamepad) -> tuple[DeviceFeed, list[Reading]]:
    """Returns a feed that has read all, and what it handed on."""
    published: list[Reading] = []
    feed = DeviceFeed(
        "gamepad", device, FeedConfig(autorepeat_rate=0.0, coalesce_interval=0.0), lambda each: published.append(each)
    )
    for _ in range(3 * len(device.says) + 3):
        feed._open_at_s = -math.inf  # without the second between two tries
        feed.step(0.0)
    assert not device.says
    for reading in published:
        assert problem_of(reading, device.axes, device.buttons) is None, reading
        assert {*map(type, reading.axes)} == {float} and {*map(type, reading.buttons)} == {int}
    return feed, published


@pytest.mark.parametrize("seed, name", enumerate(FAULTS))
def test_each_fault_is_named_and_valid_readings_continue(seed, name, caplog):
    """Where, when and how often is up to the seed."""
    generator, (spoil, reason) = random.Random(seed), FAULTS[name]
    says: list[Any] = moved(generator)
    bad = sorted(generator.sample(range(1, READINGS), generator.randint(1, 5)))
    for index in bad:
        says[index] = spoil(says[index], generator.randrange(6))
    end = says[-1]
    with caplog.at_level(logging.WARNING, "operator_node"):
        feed, published = played(Gamepad(says))
    assert sum(feed.refused.values()) == len(bad) and all(reason in each for each in feed.refused), feed.refused
    assert any(reason in line for line in caplog.messages)
    if name != "an error":  # after which it was opened anew, and stays at rest where it has not been there
        assert published[-1][:2] == end[:2]


def test_a_sound_device_has_no_fault():
    """Else the tests above could not fail."""
    for seed in range(20):
        says = moved(random.Random(seed))
        end = says[-1]
        feed, published = played(Gamepad(says))
        assert not feed.refused and not feed.held and published[-1][:2] == end[:2]


@pytest.mark.parametrize(
    "stuck, held",
    [
        (Reading((0.4, 0.0, 1.0), (0, 0)), "axis 'x'"),
        (Reading((0.0, 1.0, 0.0), (0, 0)), "axis 'y', axis 'trigger'"),  # swapped: the trigger is where y should be
        (Reading((0.0, 0.0, 1.0), (1, 0)), "button 'a'"),
    ],
    ids=["stuck", "swapped", "button stuck"],
)
def test_device_never_at_rest_moves_nothing_and_is_reported(stuck, held, caplog):
    feed, published = played(Gamepad([stuck] * 10))
    assert published == [Reading((0.0, 0.0, 1.0), (0, 0))] and ", ".join(feed.held) == held
    feed._held_warning_due_s -= HELD_S
    with caplog.at_level(logging.WARNING, "operator_node"):
        for _ in range(3):
            feed.step(0.0)
    assert caplog.messages == [
        f"gamepad: {held} not at rest since it was opened; release it: until then it counts as at rest"
    ]
    feed._device.says = [feed._device.at_rest()]
    feed.step(0.0)
    assert not feed.held
    feed.close()


def test_a_device_that_repeats_itself_is_heard_once():
    held = Reading((0.05, 0.0, 1.0), (0, 0))
    feed, published = played(Gamepad([held] * 5000))
    assert [reading[:2] for reading in published] == [((0.0, 0.0, 1.0), (0, 0)), held[:2]] and not feed.refused


def test_reasons_without_end_are_counted_in_bounded_memory():
    rest = Reading((0.0, 0.0, 1.0), (0, 0))
    feed, _ = played(Gamepad([rest._replace(refused=(f"packet {number} is odd",)) for number in range(1000)]))
    assert len(feed.refused) == MAX_REASONS + 1 and sum(feed.refused.values()) == 1000


def test_actions_without_end_wait_in_bounded_memory():
    feed, _ = played(Gamepad([]))
    done: list[int] = []
    for number in range(100_000):
        feed.post(lambda number=number: done.append(number))
    feed.post(lambda: feed.post(lambda: done.append(-1)))  # done with the next step, so that it comes to an end
    feed.step(0.0)
    assert len(done) < 2000 and done[-1] == 99_999
    feed.step(0.0)
    assert done[-1] == -1


def test_a_full_scale_that_is_too_small_is_named():
    device = spacenav.Spacenav(spacenav.SpacenavConfig(full_scale=300.0))
    device._process((spacenav.MOTION, 350, 0, 0, 0, 0, 0, 0))
    assert device._refused == ["a motion beyond full_scale, which is cut off there"] and device._motion[1] == -1.0


def test_device_disconnected_while_held_returns_at_rest():
    says = [Reading((0.0, 0.0, 1.0), (0, 0)), Reading((0.08, 0.0, 1.0), (0, 0)), DeviceError("gamepad", "cut")]
    says += [Reading((0.8, 0.0, 1.0), (1, 0))]
    feed, published = played(Gamepad(says))
    assert published[-1] == Reading((0.0, 0.0, 1.0), (0, 0)) and feed.held == ("axis 'x'", "button 'a'")
