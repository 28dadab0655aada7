"""The example with many things, as a user launches it: they fall on the table, and the camera sees them."""

from __future__ import annotations

import numpy as np
import pytest
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import Image, PointCloud2
from tf2_msgs.msg import TFMessage

SLOW_S = 120.0
THINGS = 25
TABLE_M = 0.4
"""Height of the table."""


@pytest.fixture
def example(ros_master, tmp_path):
    system = RosSystem(tmp_path)
    try:
        system.start(["roslaunch", "rpbi_examples", "clutter.launch", "headless:=true"])
        yield system
    finally:
        system.close()


@pytest.mark.thorough
def test_objects_fall_on_the_table_and_appear_in_the_cloud(example):
    moving = example.listen("/tf", TFMessage)

    def heights() -> dict[str, list[float]]:
        found: dict[str, list[float]] = {}
        for each in (each for message in list(moving.messages) for each in message.transforms):
            found.setdefault(each.child_frame_id, []).append(each.transform.translation.z)
        return found

    def lie() -> bool:
        found = heights()
        last = [each[-20:] for each in found.values() if len(each) > 40]
        return len(last) == THINGS and all(np.ptp(each) < 1e-3 for each in last)

    wait_until(lie, "all things lie still", SLOW_S, every_s=0.5)
    ends = [each[-1] for each in heights().values()]
    assert sum(TABLE_M - 0.05 < height < TABLE_M + 0.2 for height in ends) >= THINGS - 2
    # Nothing is drawn before somebody looks
    colour = example.listen("/rpbi/camera/colour/image", Image)
    depth = example.listen("/rpbi/camera/depth/image", Image)
    bodies = example.listen("/rpbi/camera/segmentation", Image)
    cloud = example.listen("/rpbi/camera/pointcloud", PointCloud2)
    pixels = np.frombuffer(bodies.wait_for(1, SLOW_S)[-1].data, np.uint16)
    seen, counts = np.unique(pixels, return_counts=True)
    assert (counts > 20).sum() >= THINGS, "nearly all things, the table and the floor"
    assert colour.wait_for(1, SLOW_S)[-1].encoding == "rgb8"
    distances = np.frombuffer(depth.wait_for(1, SLOW_S)[-1].data, np.float32)
    assert 0.3 < distances.min() < 0.8
    points = np.frombuffer(cloud.wait_for(1, SLOW_S)[-1].data, np.float32).reshape(-1, 4)
    assert np.isfinite(points[:, 2]).sum() > 100_000
