"""Pytest tests that every input device must pass. To test your own device, derive a class from `DeviceConformance`."""

import contextlib
import random
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import pytest

from operator_node.devices.device_feed import DeviceFeed, FeedConfig, problem_of

from .device import Device, DeviceClosedError, DeviceError, Reading
from .devices import DEVICES

PATIENCE_S = 60.0
"""Longest time to wait for an expected event on a busy computer [s]. Afterwards the test fails."""
STEP_S = 0.01
READINGS_TO_SEE = 20
"""Number of feed steps that are checked for jumps after a device has come back."""


class Reader:
    """Runs a `DeviceFeed` with a device, and records all published readings.

    Attributes:
        device: The device.
        feed: The feed that reads the device.
        readings: All published readings, the newest last.
    """

    def __init__(self, name: str, device: Device) -> None:
        self.device = device
        self.readings: list[Reading] = []
        self.feed = DeviceFeed(name, device, FeedConfig(autorepeat_rate=0.0), self._on_reading)

    def _on_reading(self, reading: Reading) -> None:
        problem = problem_of(reading, self.device.axes, self.device.buttons)
        assert problem is None, f"{problem}: {reading}"
        self.readings.append(reading)

    @property
    def last(self) -> Reading:
        """The newest reading."""
        return self.readings[-1]

    @property
    def is_at_rest(self) -> bool:
        """Whether all axes and buttons of the newest reading are at rest."""
        return self.last[:2] == self.device.at_rest()[:2]

    def axis(self, name: str) -> float:
        """Returns the value of an axis in the newest reading."""
        return self.last.axes[[*self.device.axes].index(name)]

    def is_free(self, axis: str) -> bool:
        """Returns whether an axis has been at rest at least once since the device was opened."""
        return [*self.device.axes].index(axis) in self.feed.free_axes

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Steps the feed until a condition holds. Fails after `PATIENCE_S`; `what` describes the condition."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, f"timed out waiting until {what}; the last readings: {self.readings[-5:]}"
            self.feed.step(STEP_S)


class DeviceConformance:
    """Base class with the tests that every device must pass.

    A subclass names the device, and implements how it is moved. The motion must come from the real hardware or from an
    emulator of the hardware, not from the device's Python object. For abilities that the device lacks, the subclass
    keeps the defaults, for example of `moves`, `presses` or `garbage`.

    Attributes:
        device_name: Name of a device in the table `DEVICES`, or `"their_package.module:Class"`.
        options: Options of the device.
        moves: Names of axes that can move in both directions.
        presses: Names of buttons that can be pressed.
        can_be_unplugged: Whether `unplug` and `plug` are implemented.
        pieces_of_garbage: Number of invalid inputs that the test sends.
        shows_what_is_held: Whether the device, when it is plugged in, reports an axis that is already held.
    """

    device_name: ClassVar[str]
    options: ClassVar[Mapping[str, Any]] = {}
    moves: ClassVar[tuple[str, ...]] = ()
    presses: ClassVar[tuple[str, ...]] = ()
    can_be_unplugged: ClassVar[bool] = True
    pieces_of_garbage: ClassVar[int] = 100
    shows_what_is_held: ClassVar[bool] = False

    # --- Methods that a subclass overrides.

    def make(self) -> Device:
        """Returns a new device. A subclass also starts the emulator that moves the device."""
        return DEVICES.make(self.device_name, self.options)

    def move(self, axis: str, share: float) -> None:
        """Moves an axis to the value `share` in [-1, 1] and holds the axis there. All other axes are at rest."""
        raise NotImplementedError

    def press(self, button: str, is_down: bool) -> None:
        """Presses or releases a button."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Unplugs the device."""

    def plug(self) -> None:
        """Plugs the device in again."""

    def garbage(self, generator: random.Random) -> None:
        """Sends one invalid input, as a broken or hostile device would."""

    def clean_up(self) -> None:
        """Releases everything that `make` has started."""

    # --- Fixtures and helper of the tests.

    @pytest.fixture
    def device(self) -> Iterator[Device]:
        """Yields a new device, and closes the device after the test."""
        device = self.make()
        try:
            yield device
        finally:
            device.close()
            self.clean_up()

    @pytest.fixture
    def reader(self, device: Device) -> Reader:
        """Returns a reader whose device is open and has reported all axes in `moves` at rest."""
        reader = Reader(self.device_name, device)
        reader.until(lambda: bool(reader.readings), "the device is open")
        self.settle(reader)
        return reader

    def settle(self, reader: Reader) -> None:
        """Steps the feed until the device has reported all axes in `moves` at rest."""
        for axis in self.moves:
            reader.until(lambda: reader.is_free(axis), f"axis '{axis}' is known to be at rest")  # noqa: B023

    # --- The tests.

    def test_names_are_unique_and_the_first_reading_is_at_rest(self, reader: Reader) -> None:
        """Names are unique, and the first reading equals `at_rest`."""
        device = reader.device
        assert len(set(device.axes)) == len(device.axes) and len(set(device.buttons)) == len(device.buttons)
        assert {*self.moves} <= {*device.axes} and {*self.presses} <= {*device.buttons}
        assert reader.readings[0][:2] == device.at_rest()[:2]

    @pytest.mark.parametrize("share", (1.0, -1.0))
    def test_each_axis_moves_in_both_directions_and_back(self, reader: Reader, share: float) -> None:
        """Each axis's value has the sign of the motion, and returns to rest afterwards. Other axes stay at rest."""
        rest = reader.device.at_rest().axes
        for axis in self.moves:
            self.move(axis, share)
            reader.until(lambda: reader.axis(axis) * share > 0.5, f"axis '{axis}' is at {share:g}")  # noqa: B023
            changed = [name for name, value, at in zip(reader.device.axes, reader.last.axes, rest) if value != at]
            assert changed == [axis], reader.last
            self.move(axis, 0.0)
            reader.until(lambda: reader.last.axes == rest, f"axis '{axis}' is at rest")

    def test_each_button_goes_down_and_up(self, reader: Reader) -> None:
        """Each button can be pressed and released, and no other button changes."""
        for button in self.presses:
            index = [*reader.device.buttons].index(button)
            self.press(button, True)
            reader.until(lambda: reader.last.buttons[index] == 1, f"button '{button}' is down")  # noqa: B023
            assert sum(reader.last.buttons) == 1, reader.last
            self.press(button, False)
            reader.until(lambda: not any(reader.last.buttons), f"button '{button}' is up")

    def test_it_may_be_closed_twice_and_opened_again(self, device: Device) -> None:
        """A device can be closed repeatedly, even before it is opened. A closed device raises an error when read."""
        for _ in range(2):
            device.close()
            device.close()
            device.open()
        device.close()
        with pytest.raises(DeviceError):
            device.read(0.0)

    def test_device_at_rest_reports_nothing(self, reader: Reader) -> None:
        """An untouched device stops reporting new readings, so that `read(0.0)` returns None."""
        end_s = time.monotonic() + PATIENCE_S
        while any(reader.device.read(0.0) is not None for _ in range(3)):
            assert time.monotonic() < end_s, "it keeps reporting readings at rest"

    def test_when_it_is_closed_the_last_reading_is_at_rest(self, reader: Reader) -> None:
        """Closing publishes one last reading at rest, even if an axis is held. Closing again publishes nothing."""
        for axis in self.moves[:1]:
            self.move(axis, 1.0)
            reader.until(lambda: not reader.is_at_rest, "it moves")
        count = len(reader.readings)
        for _ in range(2):
            reader.feed.close()
            assert len(reader.readings) == count + 1 and reader.is_at_rest

    def test_missing_device_raises_an_error_with_a_reason(self, device: Device) -> None:
        """Opening an absent device raises a DeviceError with a reason, and not a DeviceClosedError."""
        if not self.can_be_unplugged:
            pytest.skip(f"'{self.device_name}' cannot be unplugged")
        self.unplug()
        with pytest.raises(DeviceError) as caught:
            device.open()
        assert caught.value.reason and not isinstance(caught.value, DeviceClosedError)
        self.plug()
        device.open()

    def test_device_rests_while_unplugged_and_returns_without_a_jump(self, reader: Reader) -> None:
        """If a device is unplugged and plugged in while an axis is held, this axis stays at rest until its release."""
        if not self.can_be_unplugged:
            pytest.skip(f"'{self.device_name}' cannot be unplugged")
        axis = self.moves[0]
        self.move(axis, 1.0)
        reader.until(lambda: reader.axis(axis) > 0.5, "it moves")
        self.unplug()
        reader.until(lambda: reader.feed.problem is not None, "the feed reports that it has gone")
        assert reader.is_at_rest, "the last reading is not at rest"
        count = len(reader.readings)
        self.plug()
        if self.shows_what_is_held:
            self.move(axis, 1.0)
        reader.until(lambda: reader.feed.problem is None, "it is back")
        for _ in range(READINGS_TO_SEE):
            reader.feed.step(STEP_S)
        if self.shows_what_is_held:
            assert not reader.is_free(axis), "the held axis is not seen"
        for reading in reader.readings[count:]:
            assert reading[:2] == reader.device.at_rest()[:2], "it jumped"
        self.move(axis, 0.0)
        self.settle(reader)
        self.move(axis, 1.0)
        reader.until(lambda: reader.axis(axis) > 0.5, "it moves again")

    def test_garbage_is_refused_and_counted(self, reader: Reader) -> None:
        """Invalid inputs neither raise exceptions nor cause invalid readings. The feed counts invalid inputs."""
        if type(self).garbage is DeviceConformance.garbage:
            pytest.skip(f"garbage cannot be sent to '{self.device_name}' from outside")
        generator = random.Random(1)
        for _ in range(self.pieces_of_garbage):
            with contextlib.suppress(OSError):  # the device has closed the connection
                self.garbage(generator)
            reader.feed.step(0.0)
        reader.until(lambda: sum(reader.feed.refused.values()) > 0, "something is refused")
        assert all(reader.feed.refused)
