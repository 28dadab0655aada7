"""The examples with cameras, as a user launches them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rendering import rotation_matrix
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import Image, PointCloud2
from tf2_msgs.msg import TFMessage

from robot_model.geometry import Pose

pytestmark = pytest.mark.thorough

SLOW_S = 120.0
FACTOR = {"pybullet_rgbd_example": 1, "pybullet_objects_example": 3}
"""Real-time factor of each example; clouds of 640 by 480 points at three times real time are too much for two cores."""


@pytest.fixture(params=FACTOR)
def example(request, ros_master, tmp_path):
    system = RosSystem(tmp_path)
    try:
        factor = f"real_time_factor:={FACTOR[request.param]}"
        system.start(["roslaunch", "rpbi_examples", f"{request.param}.launch", "headless:=true", factor])
        yield request.param, system
    finally:
        system.close()


def poses(listener, frame):
    """Returns stamps [ns] and poses of a frame that have been on TF."""
    found = [one for message in list(listener.messages) for one in message.transforms if one.child_frame_id == frame]
    return {one.header.stamp.to_nsec(): _pose(one.transform) for one in found}


def _pose(transform):
    position, quat = transform.translation, transform.rotation
    return Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))


def test_camera_sees_the_flying_ball_where_tf_has_it(example):
    name, system = example
    moving = system.listen("/tf", TFMessage)
    box_heights = lambda: [pose.position[2] for pose in poses(moving, "rpbi/box").values()]  # noqa: E731
    wait_until(lambda: len(box_heights()) > 10, "a box is there", SLOW_S)
    wait_until(lambda: max(box_heights()) > 1.05 and min(box_heights()) < 0.3, "it was thrown up and fell", SLOW_S)

    def came_again():
        boxes = poses(moving, "rpbi/box")
        later = min(boxes) + 2_500_000_000
        return any(pose.position[2] > 0.9 for stamp, pose in boxes.items() if stamp > later)

    wait_until(came_again, "another one came", SLOW_S)
    wait_until(lambda: np.ptp([pose.position[1] for pose in poses(moving, "rpbi/figure_eight").values()]) > 0.7,
               "the frame has flown from end to end", SLOW_S)  # fmt: skip
    assert system.listen("/rpbi/camera/colour/image", Image).wait_for(1)[0].width == 640
    if name == "pybullet_rgbd_example":
        _see_cyan_ball(system, moving)


def _see_cyan_ball(system, moving):
    cloud = system.listen("/rpbi/camera/pointcloud", PointCloud2)
    messages = cloud.wait_for(10, SLOW_S)
    wait_until(lambda: max(poses(moving, "rpbi/camera")) > messages[9].header.stamp.to_nsec(), "TF is there", SLOW_S)
    cameras = poses(moving, "rpbi/camera")
    distances = []
    for message in messages[2:10]:
        points = np.frombuffer(message.data, np.float32).reshape(-1, 4)
        colour = np.ascontiguousarray(points[:, 3]).view(np.uint8).reshape(-1, 4).astype(int)
        cyan = (colour[:, 0] > 60) & (colour[:, 1] > 60) & (colour[:, 2] < 30) & np.isfinite(points[:, 2])
        if cyan.sum() < 300:
            continue
        stamp = message.header.stamp.to_nsec()
        camera = cameras[min(cameras, key=lambda other: abs(other - stamp))]
        in_world = points[cyan, :3] @ rotation_matrix(camera.quat_xyzw).T + camera.position
        middle = np.median(in_world, axis=0)
        # the figure stands upright at x = 0.5, between 0.45 and 0.85 m high
        distances.append(abs(middle[0] - 0.5))
        assert 0.2 < middle[2] < 1.1 and math.hypot(*middle[:2]) < 1.0
    assert len(distances) >= 4 and max(distances) < 0.25
