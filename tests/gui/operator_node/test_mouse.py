"""The mouse, moved by real motions in its window."""

from __future__ import annotations

import contextlib

import pytest
from ros_system import wait_until
from tries import tries

from operator_node.conformance import DeviceConformance, Reader
from operator_node.device import DeviceClosedError, DeviceError
from operator_node.devices import DEVICES

NUMBERS = {"left": "1", "middle": "2", "right": "3"}
WHEEL = {True: "4", False: "5"}


@pytest.fixture(autouse=True)
def display(screen, monkeypatch):
    """Windows of this process are on the virtual screen, and the pointer is in the middle of where they are."""
    monkeypatch.setenv("DISPLAY", screen.environment["DISPLAY"])
    yield
    screen.run("xdotool", "mouseup", "1", "mouseup", "2", "mouseup", "3")


def window(screen):
    """Returns the window of the mouse."""
    return wait_until(lambda: [each for each in screen.windows() if each.title == "mouse"], "its window is there")[0]


class TestMouse(DeviceConformance):
    device_name = "mouse"
    options = {"wheel_step": 1.0}
    moves = ("x", "y", "wheel")
    presses = ("middle", "right")
    can_be_unplugged = False

    @pytest.fixture(autouse=True)
    def _screen(self, screen):
        self.screen = screen

    def move(self, axis, share):
        place = window(self.screen)
        x, y = place.x + place.width // 2, place.y + place.height // 2
        if axis == "wheel":
            commands = ["mousemove", x, y]
            if share:
                commands += ["click", WHEEL[share > 0]]
        elif share == 0.0:
            commands = ["mouseup", 1]
        else:
            way = round(0.9 * share * place.width / 2)
            commands = ["mousemove", x, y, "mousedown", 1, "mousemove"]
            commands += [x + way, y] if axis == "x" else [x, y - way]
        self.screen.run("xdotool", *map(str, commands))

    def press(self, button, is_down):
        place = window(self.screen)
        middle = [str(place.x + place.width // 2), str(place.y + place.height // 2)]
        self.screen.run("xdotool", "mousemove", *middle, "mousedown" if is_down else "mouseup", NUMBERS[button])


@pytest.fixture
def open_mouse():
    """Opens a mouse with options."""
    with contextlib.ExitStack() as opened:

        def open_mouse(**options):
            reader = Reader("mouse", DEVICES.make("mouse", options))
            opened.callback(reader.feed.close)
            reader.until(lambda: len(reader.feed.free_axes) == 3, "it is open")
            return reader

        yield open_mouse


@pytest.fixture
def reader(open_mouse):
    return open_mouse()


def test_drag_is_measured_from_its_start_in_half_windows(screen, reader):
    place = window(screen)
    x, y = place.x + 60, place.y + 80
    screen.run("xdotool", "mousemove", str(x), str(y), "mousedown", "1", "mousemove", str(x + 50), str(y + 100))
    reader.until(lambda: reader.axis("y") < -0.4, "it is dragged")
    assert reader.last.axes == pytest.approx((50 / 200, -100 / 200, 0.0))
    assert reader.last.buttons == (1, 0, 0)
    screen.run("xdotool", "mousemove", str(place.x + 1000), str(y))
    reader.until(lambda: reader.axis("x") == 1.0, "it is dragged out of the window")
    screen.run("xdotool", "mouseup", "1")
    reader.until(lambda: reader.is_at_rest, "it is let go")


def test_a_drag_before_the_first_reading_counts(screen):
    """On a busy machine, the window may be shown and pressed before the device is first read."""
    reader = Reader("mouse", DEVICES.make("mouse", {}))
    with contextlib.closing(reader.feed):
        reader.feed.step(0.0)
        place = window(screen)
        at = [str(place.x + 60), str(place.y + 80)]
        screen.run("xdotool", "mousemove", *at, "mousedown", "1", "mousemove", str(place.x + 160), str(place.y + 80))
        reader.until(lambda: reader.axis("x") > 0.4, "it is dragged")


def test_notches_of_the_wheel_add_up(screen, open_mouse):
    reader = open_mouse(wheel_return_s=600.0)
    place = window(screen)
    screen.run("xdotool", "mousemove", str(place.x + 60), str(place.y + 80), "click", "5", "click", "5")
    reader.until(lambda: reader.axis("wheel") < -0.4, "it turns")
    assert reader.last.axes == (0.0, 0.0, -0.5)


def test_wheel_returns_by_itself_after_it_was_read(screen):
    """Though the time is over before anybody asks."""
    device = DEVICES.make("mouse", {"wheel_return_s": 1e-6})
    device.open()
    with contextlib.closing(device):
        wait_until(lambda: device.read(0.01), "its window is open")
        place = window(screen)
        screen.run("xdotool", "mousemove", str(place.x + 60), str(place.y + 80), "click", "5")
        told = []
        for _ in tries("it turns and returns"):
            reading = device.read(0.01)
            told += [reading.axes] if reading else []
            if told[-2:] == [(0.0, 0.0, -0.25), (0.0, 0.0, 0.0)]:
                break


def test_a_window_that_is_hidden_lets_go(screen, reader):
    place = window(screen)
    at = [str(place.x + 60), str(place.y + 80)]
    screen.run("xdotool", "mousemove", *at, "mousedown", "1", "mousemove", str(place.x + 160), str(place.y + 80))
    reader.until(lambda: reader.axis("x") > 0.4, "it is dragged")
    screen.run("xdotool", "search", "--name", "^mouse$", "windowunmap")
    reader.until(lambda: reader.is_at_rest, "it is let go")


def test_closing_the_window_is_the_end(screen, reader):
    reader.device._window._note_closed()  # what the cross of a window manager does, which is not there
    with pytest.raises(DeviceClosedError, match="closed"):
        reader.until(lambda: False, "it ends")
    assert reader.is_at_rest
    wait_until(lambda: not [each for each in screen.windows() if each.title == "mouse"], "its window has gone")


def test_missing_screen_is_reported_with_the_variable_to_set(monkeypatch):
    monkeypatch.delenv("DISPLAY")
    with pytest.raises(DeviceError, match="DISPLAY"):
        DEVICES.make("mouse", {}).open()
