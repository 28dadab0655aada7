"""In RViz, as the example opens it, a mouse drags the target by its handles, and the arm follows."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import rospy
from ros_system import RosSystem, wait_until
from rviz_view import RvizView, find_view, launch_with_rviz

CONFIG_FILE = Path(__file__).resolve().parents[3] / "src/rpbi_examples/rviz/kuka_lwr_ik_example.rviz"
TARGET, TIP = "rpbi/figure_eight", "rpbi/kuka_lwr/end_effector_ball"
HANDLE_M = 0.16
"""How far off the target its arrows are, for handles of 0.2 m."""
TIP_OF_CAMERA_PX, TIP_OF_HANDLE_PX = 300, 200
"""RViz's status bar tells what the mouse does: much where it moves the camera, little where it moves a handle."""
NEAR_M = 0.01
SLOW_S = 300.0


@pytest.fixture(scope="module")
def example(ros_master, screen, tmp_path_factory):
    """The example as a user with a screen launches it to drag the arm; it tracks the target."""
    system = RosSystem(tmp_path_factory.mktemp("drag"))
    try:
        process = launch_with_rviz(system, screen, "kuka_lwr_ik_example.launch", "drag:=true")
        wait_until(lambda: "the arm tracks its target" in system.output(process), "the arm tracks", SLOW_S)
        yield system
    finally:
        system.close()


@pytest.fixture(scope="module")
def position(example):
    """Where a frame is in the world [m]."""
    buffer = example.listen_to_tf()

    def position(frame):
        found = buffer.lookup_transform("rpbi/world", frame, rospy.Time(0)).transform.translation
        return np.array([found.x, found.y, found.z])

    wait_until(lambda: all(buffer.can_transform("rpbi/world", each, rospy.Time(0)) for each in (TARGET, TIP)), "TF")
    return position


class Mouse:
    """A mouse in RViz's view.

    Args:
        screen: Where RViz is.
    """

    def __init__(self, screen):
        self._screen = screen
        self._window = wait_until(lambda: find_view(screen), "RViz is open", SLOW_S, every_s=0.5)
        self._view = RvizView(CONFIG_FILE, self._window.width, self._window.height)

    def drag(self, start, end):
        """Drags what is at a point of the world on the screen to another one, if it is a handle."""
        corner = self._at(10, 10)
        wait_until(lambda: self._tip_px(corner) > TIP_OF_CAMERA_PX, "the mouse is over the background", SLOW_S)
        here, there = (self._at(*self._view.project(point)[:2]) for point in (start, end))
        wait_until(lambda: 0 < self._tip_px(here) < TIP_OF_HANDLE_PX, "the mouse is over a handle", SLOW_S)
        self._screen.run("xdotool", "mousemove", *here.astype(str), "mousedown", "1")
        for share in np.linspace(0.1, 1.0, 10):
            self._screen.run("xdotool", "mousemove", *np.rint(here + share * (there - here)).astype(int).astype(str))
            time.sleep(0.05)
        self._screen.run("xdotool", "mouseup", "1")

    def _at(self, column, row):
        """Returns where a pixel of the view is on the screen."""
        return np.rint([self._window.x + column, self._window.y + row]).astype(int)

    def _tip_px(self, place):
        """Moves the mouse a little at a place of the screen; returns how long a text the status bar has then."""
        for x in (place[0] + 1, place[0]):
            self._screen.run("xdotool", "mousemove", str(x), str(place[1]))
            time.sleep(0.1)
        main = next(window for window in self._screen.windows() if "- RViz" in window.title)
        text = self._screen.grab(main)[-24:-4, 80:-120].max(axis=-1) < 100
        columns = np.flatnonzero(text.any(axis=0))
        return int(columns[-1]) if len(columns) else 0


@pytest.fixture(scope="module")
def mouse(example, screen):
    try:
        return Mouse(screen)
    except TimeoutError as error:
        said = [example.output(process)[-3000:] for process in example.processes]
        raise TimeoutError("\n".join([str(error), *map(str, screen.windows()), *said])) from None


@pytest.mark.thorough
@pytest.mark.parametrize(
    "way",
    [
        pytest.param((0.0, 0.0, 0.1), id="up"),
        pytest.param((-0.08, 0.0, 0.0), id="away", marks=pytest.mark.thorough),
    ],
)
def test_arm_follows_a_target_that_is_dragged_with_the_mouse(position, mouse, way):
    before, way = position(TARGET), np.array(way)
    handle = before + HANDLE_M * way / np.linalg.norm(way)
    mouse.drag(handle, handle + way)

    def is_there():
        moved = position(TARGET) - before
        return np.linalg.norm(moved - way) < NEAR_M

    wait_until(is_there, f"the target has moved by {way}", SLOW_S)
    wait_until(lambda: np.linalg.norm(position(TIP) - position(TARGET)) < NEAR_M, "the tip has followed", SLOW_S)
