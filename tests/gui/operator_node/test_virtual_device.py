"""The window of the virtual haptic device: the mouse moves the handle, the force is an arrow, closing it ends it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from ros_system import wait_until

from operator_node.device import DeviceError
from operator_node.haptics.device import DeviceEnded
from operator_node.haptics.devices.virtual import VirtualConfig, VirtualDevice

TITLE = "Virtual haptic device"
MIDDLE_PX = 210


@pytest.fixture
def device(screen, monkeypatch):
    """The device on a screen of its own."""
    monkeypatch.setenv("DISPLAY", screen.environment["DISPLAY"])
    device = VirtualDevice(VirtualConfig())
    device.open()
    yield device
    device.close()


def find_window(screen):
    """Returns the device's window once it is mapped: before, it gets no mouse."""
    screen.run("xdotool", "search", "--sync", "--onlyvisible", "--name", TITLE)
    return next((window for window in screen.windows() if window.title == TITLE), None)


def red_pixels(screen, window) -> int:
    red, green, blue = np.moveaxis(screen.grab(window).astype(int), -1, 0)
    return int(((red > 180) & (green < 90) & (blue < 90)).sum())


def test_mouse_moves_the_handle_and_the_force_is_an_arrow(screen, device):
    window = wait_until(lambda: find_window(screen), "the window is open")

    def go_on(force=(0.0, 0.0, 0.0)):
        device.send(force, time.monotonic() + 0.5)
        return device.read()

    def drag(button: str, right: int, down: int) -> None:
        x, y = window.x + MIDDLE_PX, window.y + MIDDLE_PX
        screen.run("xdotool", "mousemove", str(x), str(y), "mousedown", button)
        screen.run("xdotool", "mousemove", str(x + right), str(y + down), "mouseup", button)

    wait_until(lambda: go_on() and red_pixels(screen, window) == 0, "there is no force")
    drag("1", 60, -90)
    wait_until(
        lambda: (r := go_on()) and r.position[0] > 0.04 and r.position[1] < -0.025, "right is -y, up the page is x"
    )
    drag("3", 0, 60)
    wait_until(lambda: (r := go_on()) and r.position[2] < -0.025, "the right button is for z")
    screen.run("xdotool", "click", "--repeat", "5", "4")
    wait_until(lambda: (r := go_on()) and r.position[2] > -0.024, "and so is the wheel")
    still = wait_until(lambda: (r := go_on()) and max(map(abs, r.velocity)) < 1e-3 and r, "it is at rest")
    pushed = wait_until(
        lambda: (r := go_on((-5.0, 0.0, 0.0))) and r.position[0] < still.position[0] - 0.01 and r, "the force pushes it"
    )
    assert pushed.position[1] == pytest.approx(still.position[1], abs=1e-3)
    wait_until(lambda: go_on((-5.0, 0.0, 0.0)) and red_pixels(screen, window) > 50, "the force is drawn")
    device._process.terminate()

    def closed():
        try:
            go_on()
        except DeviceEnded:
            return True
        return False

    wait_until(closed, "the device says that its window was closed")


def test_returning_handle_goes_back_when_released(screen, monkeypatch):
    monkeypatch.setenv("DISPLAY", screen.environment["DISPLAY"])
    device = VirtualDevice(VirtualConfig(returns=True))
    device.open()
    try:
        window = wait_until(lambda: find_window(screen), "the window is open")

        def height() -> float:
            reading = device.read()
            return 0.0 if reading is None else reading.position[2]

        x, y = window.x + MIDDLE_PX, window.y + MIDDLE_PX
        screen.run("xdotool", "mousemove", str(x), str(y), "mousedown", "3", "mousemove", str(x), str(y - 60))
        wait_until(lambda: height() > 0.025, "it is lifted")
        screen.run("xdotool", "mouseup", "3")
        wait_until(lambda: (r := device.read()) and abs(r.position[2]) < 1e-3, "it is back")
        turn = ("click", "--repeat", "9", "--delay", "10", "4")  # it goes back soon
        wait_until(lambda: screen.run("xdotool", *turn) or height() > 0.01, "the wheel lifts it")
        wait_until(lambda: (r := device.read()) and abs(r.position[2]) < 1e-3, "and lets it down")
    finally:
        device.close()


def test_without_a_screen_it_says_so(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(DeviceError, match="DISPLAY is not set"):
        VirtualDevice(VirtualConfig()).open()
