"""The feed of a device: what it hands on, and what it does not let through."""

from __future__ import annotations

import logging
import math
import random
from collections import deque

import pytest
from tries import tries

from custom_ros_tools.errors import ConfigError, MissingDependency, UnknownNameError
from custom_ros_tools.schema import ConfigModel
from operator_node.device import Device, DeviceClosedError, DeviceError, Reading
from operator_node.devices import DEVICES
from operator_node.devices.device_feed import AT_REST, DeviceFeed, FeedConfig, problem_of

STEP_S = 0.001


class TapeConfig(ConfigModel):
    """Nothing to set."""


class Tape(Device):
    """A device whose readings are written beforehand; what is an exception is raised."""

    Config = TapeConfig
    axes = ("x", "y")
    buttons = ("a",)

    def __init__(self, *tape: Reading | Exception, absent: Exception | None = None) -> None:
        self.tape = deque(tape)
        self.absent = absent
        self.closed = 0

    def open(self) -> None:
        if self.absent is not None:
            raise self.absent

    def read(self, timeout_s: float) -> Reading | None:
        if not self.tape:
            return None
        item = self.tape.popleft()
        if isinstance(item, Exception):
            raise item
        return item

    def close(self) -> None:
        self.closed += 1


def feed_of(device: Device, **config) -> tuple[DeviceFeed, list[Reading]]:
    published: list[Reading] = []
    options = {"autorepeat_rate": 0.0, "coalesce_interval": 0.0, **config}
    return DeviceFeed("tape", device, FeedConfig(**options), published.append), published


def played(device: Tape, **config) -> tuple[DeviceFeed, list[Reading]]:
    """Returns a feed that has read the whole tape, and what it published."""
    feed, published = feed_of(device, **config)
    feed.step(STEP_S)
    for _ in tries("it has read all"):
        feed.step(STEP_S)
        if not device.tape:
            break
    feed.step(STEP_S)
    return feed, published


def at(x: float, y: float = 0.0, a: int = 0) -> Reading:
    return Reading((x, y), (a,))


def test_only_changed_readings_are_published():
    _, published = played(Tape(at(0), at(0), at(0.5), at(0.5), at(0.5, 0, 1), at(0)))
    assert published == [at(0), at(0.5), at(0.5, 0, 1), at(0)]


@pytest.mark.parametrize(
    "bad, reason",
    [
        (at(math.nan), "axis 'x' is not a finite number"),
        (at(0, -math.inf), "axis 'y' is not a finite number"),
        (at("left"), "axis 'x' is not a finite number"),
        (at(1.0001), "axis 'x' is outside [-1, 1]"),
        (at(0, -300), "axis 'y' is outside [-1, 1]"),
        (at(0, 0, 2), "button 'a' is neither 0 nor 1"),
        (Reading((0.0,), (0,)), "a reading whose number of axes differs from the 2 of the device"),
        (Reading((0.0, 0.0), ()), "a reading whose number of buttons differs from the 1 of the device"),
    ],
)
def test_invalid_reading_is_counted_and_the_last_valid_one_kept(bad, reason, caplog):
    with caplog.at_level(logging.WARNING, "operator_node"):
        feed, published = played(Tape(at(0), at(0.3), bad, bad, at(0.4)))
    assert published == [at(0), at(0.3), at(0.4)]
    assert feed.refused == {reason: 2}
    (warning,) = caplog.messages
    assert warning.startswith(f"tape: refused: {reason}")


def test_readings_refused_by_the_device_are_counted_and_reading_continues():
    feed, published = played(Tape(at(0), at(0)._replace(refused=("torn", "torn")), at(0.2)._replace(refused=("torn",))))
    assert feed.refused == {"torn": 3}
    assert [reading.axes for reading in published] == [(0, 0), (0.2, 0)]


def test_input_held_at_start_counts_as_rest_until_released():
    """Each for itself; in passing rest by leaps it is not there."""
    tape = [at(0.9, 0.0, 1), at(-0.8, 0.6, 1), at(0.9 * AT_REST, 0.7, 0), at(0.5, 0.8, 1)]
    _, published = played(Tape(*tape))
    assert published == [at(0), at(0, 0.6), at(0.9 * AT_REST, 0.7), at(0.5, 0.8, 1)]


def test_no_start_reset_or_return_jumps():
    """Wherever it is held, and however it moves: only from rest, and by its own steps."""
    generator = random.Random(1)
    for _ in range(1000):
        tape: list[Reading | Exception] = []
        for _ in range(3):
            x, y = (generator.uniform(-1.0, 1.0) for _ in range(2))
            for _ in range(10):
                step_x, step_y = (generator.uniform(-AT_REST, AT_REST) for _ in range(2))
                x, y = (max(-1.0, min(1.0, each)) for each in (x + step_x, y + step_y))
                tape.append(at(x, y))
            tape.append(generator.choice((DeviceError("tape", "cut"), RuntimeError("torn"))))
        feed, published = feed_of(Tape(*tape))
        device_tape = feed._device.tape
        for _ in tries("it has read all"):
            feed._open_at_s = -math.inf  # without the second between two tries
            feed.step(0.0)
            if not device_tape:
                break
        for before, after in zip(published, published[1:]):
            for old, new in zip(before.axes, after.axes):
                assert new == 0.0 or abs(new - old) <= 2 * AT_REST, (before, after)


@pytest.mark.parametrize(
    "failure", (DeviceError("tape", "cut"), RuntimeError("torn"), OSError(5, "input/output error"))
)
def test_failing_device_returns_to_rest_and_is_opened_again(failure, caplog):
    device = Tape(at(0), at(0.5), failure, at(0), at(0.2))
    feed, published = feed_of(device)
    with caplog.at_level(logging.INFO, "operator_node"):
        for _ in tries("it is lost"):
            feed.step(STEP_S)
            if published and feed.problem is not None:
                break
        assert published[-1] == at(0) and device.closed == 1
        assert any(word in feed.problem for word in ("cut", "torn", "input/output"))
        for _ in tries("it is back"):
            feed.step(0.05)
            if published[-1] == at(0.2):
                break
    assert len([line for line in caplog.messages if "it is available now" in line]) == 1


def test_a_device_that_is_not_there_is_warned_of_once(caplog):
    device = Tape(at(0), absent=DeviceError("tape", "no such thing; plug it in"))
    feed, published = feed_of(device)
    with caplog.at_level(logging.INFO, "operator_node"):
        for _ in range(3):
            feed._open_at_s = -math.inf
            feed.step(0.0)
        assert caplog.messages == ["tape: no such thing; plug it in; looking for it once a second"]
        assert not published and feed.problem == "no such thing; plug it in"
        device.absent = None
        feed._open_at_s = -math.inf
        feed.step(0.0)
    assert caplog.messages[1:] == ["tape: it is available now"] and published == [at(0)]


def test_a_missing_library_is_an_error():
    """It will not come by itself."""
    feed, _ = feed_of(Tape(absent=MissingDependency("pygame", "apt install python3-pygame")))
    with pytest.raises(MissingDependency):
        feed.step(0.0)


def test_device_closed_by_its_person_ends_the_feed():
    device = Tape(at(0), at(1), DeviceClosedError("tape", "its window was closed"))
    feed, published = feed_of(device)
    feed.run(lambda: False, STEP_S)
    assert published[-1] == at(0) and device.closed == 1 and feed.problem == "closed"


def test_reading_is_repeated_at_a_rate_without_its_events():
    device = Tape(at(0), at(0.5)._replace(events=("click",)))
    feed, published = feed_of(device, autorepeat_rate=200.0)
    for _ in tries("it is repeated"):
        feed.step(0.02)
        if len(published) >= 6:
            break
    assert [reading.axes[0] for reading in published[-3:]] == [0.5] * 3
    assert [reading.events for reading in published if reading.events] == [("click",)]


def test_motions_within_the_interval_are_merged_but_buttons_are_immediate():
    tape = [at(0), at(0.1), at(0.2), at(0.3), at(0.3, 0, 1), at(0.4, 0, 1), at(0.5, 0, 0)]
    _, published = played(Tape(*tape), coalesce_interval=10.0)
    assert published == [at(0), at(0.3, 0, 1), at(0.5, 0, 0)]


def test_posted_calls_run_in_the_feed_and_may_fail(caplog):
    feed, _ = played(Tape(at(0)))
    done = []
    feed.post(lambda: 1 / 0)
    feed.post(lambda: done.append(1))
    feed.step(0.0)
    assert done == [1] and feed.refused == {"it failed in posted: ZeroDivisionError": 1}


def test_a_rest_that_makes_no_sense_is_refused_too():
    device = Tape(at(0), at(0.5))
    device.at_rest = lambda: at(math.nan)
    feed, published = played(device)
    feed.close()
    assert published[-1] == at(0) and "at rest, axis 'x' is not a finite number" in feed.refused


def test_no_reading_that_makes_sense_has_a_problem():
    assert problem_of(at(1.0, -1.0, 1), Tape.axes, Tape.buttons) is None


def test_names_of_devices():
    with pytest.raises(UnknownNameError, match="unknown device 'joystik'.*joystick"):
        DEVICES.make("joystik", {})
    with pytest.raises(ConfigError, match="nowhere"):
        DEVICES.make("nowhere.at_all:Device", {})
    with pytest.raises(ConfigError, match="deadzone.*got 2"):
        DEVICES.make("joystick", {"deadzone": 2.0}, "pad.yaml")
