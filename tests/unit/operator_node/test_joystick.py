"""Joysticks, by SDL's own virtual ones."""

from __future__ import annotations

import pytest

from operator_node.conformance import DeviceConformance, Reader
from operator_node.device import DeviceError
from operator_node.devices import DEVICES
from operator_node.devices.joystick import axis_of
from operator_node.devices.virtual_joystick import VirtualJoystick

AXES = 6
REST = (0.0,) * 4 + (1.0,) * 2 + (0.0,) * 2


@pytest.fixture
def gamepad():
    gamepad = VirtualJoystick()
    yield gamepad
    gamepad.unplug()


def opened(**options) -> Reader:
    reader = Reader("joystick", DEVICES.make("joystick", options))
    reader.until(lambda: bool(reader.feed.free_axes), "it is open and has said where it is")
    return reader


class TestJoystick(DeviceConformance):
    device_name = "joystick"
    moves = ("0", "1", "2", "3", "hat 0 x", "hat 0 y")
    presses = tuple(map(str, range(11)))
    shows_what_is_held = True

    def make(self):
        self.plug()
        return super().make()

    def plug(self):
        self.gamepad = VirtualJoystick()

    def unplug(self):
        self.gamepad.unplug()

    clean_up = unplug

    def move(self, axis, share):
        names = [*map(str, range(AXES)), "hat 0 x", "hat 0 y"]
        self.gamepad.move([share if name == axis else rest for name, rest in zip(names, REST)])

    def press(self, button, is_down):
        self.gamepad.move(buttons=[int(is_down and number == int(button)) for number in range(len(self.presses))])


def test_triggers_rest_at_1_and_go_to_minus_1(gamepad):
    """From the first message on, where joy_node has 0 until they are moved."""
    reader = opened()
    assert reader.readings[0].axes == REST
    gamepad.move((*REST[:4], -1.0, *REST[5:]))
    reader.until(lambda: reader.last.axes[4] == -1.0, "the trigger is pulled")
    assert reader.last.axes[5] == 1.0
    reader.feed.close()
    assert reader.last.axes == REST


def test_axes_of_another_joystick_may_be_triggers(gamepad):
    reader = opened(triggers=[0])
    assert reader.readings[0].axes[:6] == (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert 4 not in reader.feed.free_axes and reader.last.axes[4] == 0.0, "which a lever that is not at rest shows"
    reader.feed.close()


@pytest.mark.parametrize(
    "raw, deadzone, value",
    [
        (0, 0.05, 0.0),
        (1638, 0.05, 0.0),
        (-32768, 0.05, 1.0),
        (32767, 0.05, -1.0),
        (32767, 0.5, -1.0),
        (16384, 0.5, -1.6e-5),
        (-24575, 0.5, 0.5),
        (16384, 0.0, -0.50002),
    ],
)
def test_dead_zone_equals_that_of_joy_node(raw, deadzone, value):
    assert axis_of(raw, deadzone) == pytest.approx(value, abs=3e-5)


def test_sticky_buttons_stay_until_they_are_pressed_again(gamepad):
    reader = opened(sticky_buttons=True)
    for expected in (1, 0, 1):
        gamepad.move(buttons=[1])
        gamepad.move(buttons=[0])
        reader.until(lambda: reader.last.buttons[0] == expected, f"it is {expected}")  # noqa: B023
    reader.feed.close()


def test_the_shortest_tap_is_two_messages(gamepad):
    reader = opened()
    for _ in range(3):
        gamepad.move(buttons=[0, 1])
        gamepad.move(buttons=[0, 0])
    reader.until(lambda: len(reader.readings) >= 7, "all taps have come")
    assert [reading.buttons[1] for reading in reader.readings] == [0, 1, 0, 1, 0, 1, 0]
    reader.feed.close()


def test_a_force_is_felt_as_rumbling(gamepad):
    device = DEVICES.make("joystick", {})
    device.open()
    device.cue((0.3, 0.0, -0.4))
    assert gamepad.felt == pytest.approx((0.5, 0.5), abs=1e-3)
    device.rumble(1.0, 0.25)
    assert gamepad.felt == pytest.approx((1.0, 0.25), abs=1e-3)
    device.close()
    device.cue((1.0, 0.0, 0.0))


def test_joysticks_are_selected_by_number_or_name(gamepad):
    other = VirtualJoystick("flight stick")
    reader = opened(dev_name="flight")
    other.move([-1.0])
    reader.until(lambda: reader.last.axes[0] == -1.0, "it moves")
    gamepad.move([1.0])
    second = opened(dev="/dev/input/js1")
    second.feed.close()
    reader.feed.close()
    for options, named in (
        ({"dev_name": "wheel"}, "'wheel'.*virtual gamepad, flight stick"),
        ({"dev": "js2"}, "no joystick number 2"),
    ):
        with pytest.raises(DeviceError, match=named):
            DEVICES.make("joystick", options).open()
    other.unplug()


def test_unplugging_an_unopened_joystick_has_no_effect(gamepad):
    """pygame drops all events then."""
    reader = opened()
    VirtualJoystick("passing by").unplug()
    gamepad.move([1.0], [1])
    reader.until(lambda: reader.last.axes[0] == 1.0 and reader.last.buttons[0] == 1, "it is moved and pressed")
    VirtualJoystick("passing by").unplug()
    gamepad.unplug()
    reader.until(lambda: reader.feed.problem is not None, "it is missed")
    assert reader.last.axes == REST
    reader.feed.close()
