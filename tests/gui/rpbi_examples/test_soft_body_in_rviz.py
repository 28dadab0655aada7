"""RViz, as the example opens it, shows the soft torus, the forces on the cube and the camera's image."""

from __future__ import annotations

import numpy as np
import pytest
from ros_system import RosSystem, wait_until
from screen import Screen

TORUS = (242, 115, 92)
ARROW = (217, 26, 26)
SLOW_S = 120.0


@pytest.fixture(scope="module")
def screen():
    screen = Screen()
    yield screen
    screen.close()


@pytest.fixture(scope="module")
def picture(ros_master, tmp_path_factory, screen):
    """What is to be seen in the window's right part, where the world is, when called."""
    system = RosSystem(tmp_path_factory.mktemp("soft_body_in_rviz"))
    try:
        command = ["roslaunch", "rpbi_examples", "soft_body.launch", "headless:=false"]
        system.start(command, **screen.environment)
        yield lambda: screen.grab()[:, 420:]
    finally:
        system.close()


def _of_hue(picture, colour, tolerance=0.06):
    """Returns which pixels have a colour's proportions, however the light falls, unless they are dark."""
    shares = picture / np.maximum(picture.sum(axis=2, keepdims=True), 1)
    wanted = np.array(colour) / sum(colour)
    return (np.abs(shares - wanted).max(axis=2) < tolerance) & (picture.sum(axis=2) > 120)


def test_the_torus_is_there_with_its_hole(picture):
    def shows_torus_and_hole():
        is_torus = _of_hue(picture(), TORUS)
        if np.count_nonzero(is_torus) < 10_000:
            return False
        row, column = (int(places.mean()) for places in np.nonzero(is_torus))
        return np.count_nonzero(is_torus[row - 5 : row + 5, column - 5 : column + 5]) < 50

    # While it falls and settles, the hole may be hidden
    wait_until(shows_torus_and_hole, "RViz shows the torus and its hole", SLOW_S)


def test_forces_on_the_cube_are_there_as_arrows(picture):
    wait_until(lambda: np.count_nonzero(_of_hue(picture(), ARROW)) > 30, "RViz shows arrows", SLOW_S)
