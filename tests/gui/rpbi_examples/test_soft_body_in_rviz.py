"""RViz with the example's config shows the soft torus, the forces on the cube and the camera's image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from ros_system import RosSystem, wait_until
from rviz_view import start_rviz
from scipy import ndimage

pytestmark = pytest.mark.thorough

CONFIG_FILE = Path(__file__).resolve().parents[3] / "src/rpbi_examples/rviz/soft_body.rviz"
TORUS = (242, 115, 92)
ARROW = (217, 26, 26)
SLOW_S = 120.0


@pytest.fixture(scope="module")
def picture(ros_master, tmp_path_factory, screen):
    """What is to be seen in the window's right part, where the world is, when called."""
    system = RosSystem(tmp_path_factory.mktemp("soft_body_in_rviz"))
    try:
        example = system.start(["roslaunch", "rpbi_examples", "soft_body.launch", "headless:=true"])
        rviz = start_rviz(system, screen, yaml.safe_load(CONFIG_FILE.read_text()))
        yield lambda: screen.grab()[:, 420:]
        print(system.output(example), system.output(rviz))  # pytest shows it if a test failed
    finally:
        system.close()


def _of_hue(picture, colour, tolerance=0.06):
    """Returns which pixels have a colour's proportions, however the light falls, unless they are dark."""
    shares = picture / np.maximum(picture.sum(axis=2, keepdims=True), 1)
    wanted = np.array(colour) / sum(colour)
    return (np.abs(shares - wanted).max(axis=2) < tolerance) & (picture.sum(axis=2) > 120)


def _wait_for_pixels(count, least, what):
    """Waits until as many pixels are seen; says how many there were at last."""
    seen = []

    def are_enough():
        seen.append(count())
        return seen[-1] >= least

    try:
        wait_until(are_enough, what, SLOW_S)
    except TimeoutError as error:
        pytest.fail(f"{error}: at least {least} pixels, but there were {seen[-5:]}")


def test_the_torus_is_there_with_its_hole(picture):
    def of_hole():
        is_torus = ndimage.binary_opening(_of_hue(picture(), TORUS))
        return np.count_nonzero(ndimage.binary_fill_holes(is_torus) & ~is_torus)

    _wait_for_pixels(lambda: np.count_nonzero(_of_hue(picture(), TORUS)), 10_000, "RViz shows the torus")
    _wait_for_pixels(of_hole, 1_000, "RViz shows the torus' hole")  # hidden while it falls


def test_forces_on_the_cube_are_there_as_arrows(picture):
    _wait_for_pixels(lambda: np.count_nonzero(_of_hue(picture(), ARROW)), 100, "RViz shows arrows")
