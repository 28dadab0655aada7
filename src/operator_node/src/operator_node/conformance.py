"""What every device has to do, as tests for pytest; derive from `DeviceConformance` to try a device of your own."""

import contextlib
import random
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import pytest

from .device import Device, DeviceClosedError, DeviceError, Reading
from .device_feed import DeviceFeed, FeedConfig, problem_of
from .lookup import make_device

PATIENCE_S = 60.0
"""How long something that is to happen may take on a busy computer [s]."""
STEP_S = 0.01
READINGS_TO_SEE = 20
"""So many steps show what a device that came back says."""


class Reader:
    """A feed with a device, and all that it has handed on.

    Attributes:
        device: The device.
        feed: The feed.
        readings: The readings, the newest last.
    """

    def __init__(self, name: str, device: Device) -> None:
        self.device = device
        self.readings: list[Reading] = []
        self.feed = DeviceFeed(name, device, FeedConfig(autorepeat_rate=0.0), self._take)

    def _take(self, reading: Reading) -> None:
        problem = problem_of(reading, self.device.axes, self.device.buttons)
        assert problem is None, f"{problem}: {reading}"
        self.readings.append(reading)

    @property
    def last(self) -> Reading:
        """The newest reading."""
        return self.readings[-1]

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing is moved or pressed by the newest reading."""
        return self.last[:2] == self.device.at_rest()[:2]

    def axis(self, name: str) -> float:
        """Returns an axis by the newest reading."""
        return self.last.axes[[*self.device.axes].index(name)]

    def is_free(self, axis: str) -> bool:
        """Returns whether an axis has been at rest since the device was opened."""
        return [*self.device.axes].index(axis) in self.feed.free_axes

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Reads until something is so."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, f"it did not come about that {what}; the last: {self.readings[-5:]}"
            self.feed.step(STEP_S)


class DeviceConformance:
    """Tests that any device passes.

    A subclass names the device, and moves it as a person does: really, or by what stands in for it, but not by its
    Python object. What its device cannot do it leaves out: `moves`, `can_be_unplugged`, `garbage`.

    Attributes:
        device_name: What `make_device` is asked for: a name of the table, or `"their_package.module:Class"`.
        options: Its options.
        moves: Names of axes that go both ways.
        presses: Names of buttons that can be pressed.
        can_be_unplugged: Whether `unplug` and `plug` do something.
        pieces_of_garbage: How often to send something that makes no sense.
        shows_what_is_held: Whether it says at once what is held while it is plugged in.
    """

    device_name: ClassVar[str]
    options: ClassVar[Mapping[str, Any]] = {}
    moves: ClassVar[tuple[str, ...]] = ()
    presses: ClassVar[tuple[str, ...]] = ()
    can_be_unplugged: ClassVar[bool] = True
    pieces_of_garbage: ClassVar[int] = 100
    shows_what_is_held: ClassVar[bool] = False

    # --- What a subclass overrides.

    def make(self) -> Device:
        """Returns a new device, with what moves it ready."""
        return make_device(self.device_name, self.options)

    def move(self, axis: str, share: float) -> None:
        """Holds an axis at a share of its full way, in [-1, 1]; all others are at rest."""
        raise NotImplementedError

    def press(self, button: str, is_down: bool) -> None:
        """Presses a button, or lets go of it."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Takes the device away."""

    def plug(self) -> None:
        """Puts it back."""

    def garbage(self, generator: random.Random) -> None:
        """Has the device send something that makes no sense, as a broken or hostile one would."""

    def clean_up(self) -> None:
        """Ends what `make` has begun."""

    # --- What the tests use.

    @pytest.fixture
    def device(self) -> Iterator[Device]:
        """A new device; it is closed in the end."""
        device = self.make()
        try:
            yield device
        finally:
            device.close()
            self.clean_up()

    @pytest.fixture
    def reader(self, device: Device) -> Reader:
        """A reader whose device is open, and free to move."""
        reader = Reader(self.device_name, device)
        reader.until(lambda: bool(reader.readings), "the device is open")
        self.settle(reader)
        return reader

    def settle(self, reader: Reader) -> None:
        """Reads until all axes are known to be at rest."""
        for axis in self.moves:
            reader.until(lambda: reader.is_free(axis), f"axis '{axis}' is known to be at rest")  # noqa: B023

    # --- The tests.

    def test_axes_and_buttons_have_names_and_the_first_reading_is_at_rest(self, reader: Reader) -> None:
        """Names are unique, and what it says at rest makes sense."""
        device = reader.device
        assert len(set(device.axes)) == len(device.axes) and len(set(device.buttons)) == len(device.buttons)
        assert {*self.moves} <= {*device.axes} and {*self.presses} <= {*device.buttons}
        assert reader.readings[0][:2] == device.at_rest()[:2]

    @pytest.mark.parametrize("share", (1.0, -1.0))
    def test_each_axis_goes_both_ways_and_back(self, reader: Reader, share: float) -> None:
        """It has the sign of the motion, all others stay at rest, and it is at rest again when it is let go."""
        rest = reader.device.at_rest().axes
        for axis in self.moves:
            self.move(axis, share)
            reader.until(lambda: reader.axis(axis) * share > 0.5, f"axis '{axis}' is at {share:g}")  # noqa: B023
            changed = [name for name, value, at in zip(reader.device.axes, reader.last.axes, rest) if value != at]
            assert changed == [axis], reader.last
            self.move(axis, 0.0)
            reader.until(lambda: reader.last.axes == rest, f"axis '{axis}' is at rest")

    def test_each_button_goes_down_and_up(self, reader: Reader) -> None:
        """And no other with it."""
        for button in self.presses:
            index = [*reader.device.buttons].index(button)
            self.press(button, True)
            reader.until(lambda: reader.last.buttons[index] == 1, f"button '{button}' is down")  # noqa: B023
            assert sum(reader.last.buttons) == 1, reader.last
            self.press(button, False)
            reader.until(lambda: not any(reader.last.buttons), f"button '{button}' is up")

    def test_it_may_be_closed_twice_and_opened_again(self, device: Device) -> None:
        """And closed before it was ever open."""
        for _ in range(2):
            device.close()
            device.close()
            device.open()
        device.close()
        with pytest.raises(DeviceError):
            device.read(0.0)

    def test_at_rest_it_has_nothing_to_say(self, reader: Reader) -> None:
        """A device that nobody touches does not repeat itself, and reading it without waiting does not wait."""
        end_s = time.monotonic() + PATIENCE_S
        while any(reader.device.read(0.0) is not None for _ in range(3)):
            assert time.monotonic() < end_s, "it goes on saying something"

    def test_when_it_is_closed_the_last_reading_is_at_rest(self, reader: Reader) -> None:
        """Whatever was held; and there is one last reading only."""
        for axis in self.moves[:1]:
            self.move(axis, 1.0)
            reader.until(lambda: not reader.is_at_rest, "it moves")
        count = len(reader.readings)
        for _ in range(2):
            reader.feed.close()
            assert len(reader.readings) == count + 1 and reader.is_at_rest

    def test_a_device_that_is_not_there_is_an_error_that_says_so(self, device: Device) -> None:
        """And no other error, since it may come later."""
        if not self.can_be_unplugged:
            pytest.skip(f"'{self.device_name}' is always there")
        self.unplug()
        with pytest.raises(DeviceError) as caught:
            device.open()
        assert caught.value.reason and not isinstance(caught.value, DeviceClosedError)
        self.plug()
        device.open()

    def test_unplugged_it_is_at_rest_and_back_it_does_not_jump(self, reader: Reader) -> None:
        """It is unplugged and plugged in while it is held, and moves again once it was let go."""
        if not self.can_be_unplugged:
            pytest.skip(f"'{self.device_name}' is always there")
        axis = self.moves[0]
        self.move(axis, 1.0)
        reader.until(lambda: reader.axis(axis) > 0.5, "it moves")
        self.unplug()
        reader.until(lambda: reader.feed.problem is not None, "it is missed")
        assert reader.is_at_rest, "the last reading is not at rest"
        count = len(reader.readings)
        self.plug()
        if self.shows_what_is_held:
            self.move(axis, 1.0)
        reader.until(lambda: reader.feed.problem is None, "it is back")
        for _ in range(READINGS_TO_SEE):
            reader.feed.step(STEP_S)
        if self.shows_what_is_held:
            assert not reader.is_free(axis), "what is held is not seen"
        for reading in reader.readings[count:]:
            assert reading[:2] == reader.device.at_rest()[:2], "it jumped"
        self.move(axis, 0.0)
        self.settle(reader)
        self.move(axis, 1.0)
        reader.until(lambda: reader.axis(axis) > 0.5, "it moves again")

    def test_garbage_is_refused_and_counted(self, reader: Reader) -> None:
        """No exception gets out, every reading makes sense, and the reasons are counted."""
        if type(self).garbage is DeviceConformance.garbage:
            pytest.skip(f"nobody else can send to '{self.device_name}'")
        generator = random.Random(1)
        for _ in range(self.pieces_of_garbage):
            with contextlib.suppress(OSError):  # it has hung up
                self.garbage(generator)
            reader.feed.step(0.0)
        reader.until(lambda: sum(reader.feed.refused.values()) > 0, "something is refused")
        assert all(reader.feed.refused)
