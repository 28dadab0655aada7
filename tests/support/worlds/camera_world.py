"""A world for tests of cameras in ROS: a box on a floor, from above."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, box, iiwa

CAMERA = {
    "name": "eye",
    "hz": 30,
    "intrinsics": {"width": 160, "height": 120, "fov": 50.0, "range": [0.1, 10.0]},
    "object_tf": {"tf_id": "rpbi/eye"},
}
HEIGHT_M = 2.0
COLOUR, DEPTH, SEGMENTATION = (f"/rpbi/camera/{suffix}" for suffix in ("colour/image", "depth/image", "segmentation"))


def box_world(ros: Any, **more: Any) -> dict[str, Any]:
    """Returns the main configuration of a red box that rests on a floor."""
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [0.1, 0.1, 0.1], "rgbaColor": [0.9, 0.1, 0.1, 1.0]}
    red = box(createVisualShape=shape, basePosition=[0.0, 0.0, 0.1])
    return {
        "connect": {"connection_mode": "DIRECT"},
        "setGravity": {"gravZ": -9.81},
        "timeStep": 0.01,
        "collision_objects": [ros.write_yaml("floor.yaml", FLOOR)],
        "dynamic_objects": [ros.write_yaml("box.yaml", red)],
        **more,
    }


def arm_world(ros: Any, **more: Any) -> dict[str, Any]:
    """Returns the main configuration of a box on a floor beside an arm, seen by a camera."""
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.8, 0.0, 0.0]}
    robots = [ros.write_yaml("iiwa.yaml", iiwa(loadURDF=load))]
    arm_and_camera = {"setAdditionalSearchPath": "pybullet_data_path", "robots": robots, "rgbd_sensor": CAMERA}
    return box_world(ros, **{**arm_and_camera, **more})


@contextmanager
def place(*frames: str, height_m: float = HEIGHT_M) -> Iterator[None]:
    """Has frames above the floor, looking straight down."""
    message = TFMessage()
    for frame in frames:
        transform = TransformStamped(child_frame_id=frame)
        transform.header.frame_id = "rpbi/world"
        transform.transform.translation.z = height_m
        transform.transform.rotation.x = 1.0
        message.transforms.append(transform)
    publisher = rospy.Publisher("/tf_static", TFMessage, latch=True, queue_size=1)
    publisher.publish(message)
    try:
        yield
    finally:
        publisher.unregister()


def renderers(simulator: subprocess.Popen) -> list[int]:
    """Returns the process ids of all renderers that a simulator has."""
    found = subprocess.run(["pgrep", "-g", str(simulator.pid), "-f", "rpbi.render"], capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


def pixels(message: Any, dtype: npt.DTypeLike, channels: int = 1) -> npt.NDArray[Any]:
    """Returns the pixels of an image, shape (height, width) or (height, width, channels)."""
    return np.frombuffer(message.data, dtype).reshape(message.height, message.width, channels).squeeze()


def points_of(cloud: Any) -> npt.NDArray[np.float32]:
    """Returns x, y, z and the packed colour of a cloud, shape (height, width, 4)."""
    assert [(field.name, field.offset, field.datatype) for field in cloud.fields] == [
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("rgb", 12, 7)
    ]  # fmt: skip
    return np.frombuffer(cloud.data, np.float32).reshape(cloud.height, cloud.width, 4)
