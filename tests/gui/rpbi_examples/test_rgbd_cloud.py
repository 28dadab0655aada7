"""RViz with the config of the example with the orbiting camera shows the coloured point cloud."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from ros_system import RosSystem, wait_until
from rviz_view import start_rviz
from sensor_msgs.msg import PointCloud2

pytestmark = pytest.mark.thorough

CONFIG_FILE = Path(__file__).resolve().parents[3] / "src/rpbi_examples/rviz/pybullet_rgbd_example.rviz"
SLOW_S = 300.0


@pytest.fixture
def example(ros_master, screen, tmp_path):
    system = RosSystem(tmp_path)
    try:
        system.start(["roslaunch", "rpbi_examples", "pybullet_rgbd_example.launch", "headless:=true"])
        system.listen("/rpbi/camera/pointcloud", PointCloud2).wait_for(3, SLOW_S)
        start_rviz(system, screen, yaml.safe_load(CONFIG_FILE.read_text()))
        yield system
    finally:
        system.close()


def cyan_pixels(screen):
    """Returns how many pixels of RViz's 3-D view have the ball's colour; the image panel is left of it."""
    picture = screen.grab().astype(int)
    view = picture[:, picture.shape[1] // 3 :]
    red, green, blue = view[..., 0], view[..., 1], view[..., 2]
    return int(((green > 60) & (blue > 60) & (red < 30) & (abs(green - blue) < 20)).sum())


def test_ball_is_in_the_cloud_in_its_own_colour(example, screen):
    wait_until(lambda: cyan_pixels(screen) > 500, "RViz shows the cyan ball, which only the cloud has", SLOW_S)
