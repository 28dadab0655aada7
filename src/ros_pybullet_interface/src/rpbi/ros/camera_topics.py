"""The topics of a camera."""

from __future__ import annotations

from typing import NamedTuple

from sensor_msgs.msg import CameraInfo, Image


class CameraTopic(NamedTuple):
    """A topic of a camera.

    Attributes:
        stream: What of the frame it tells, as in `render.frame.Demand`.
        suffix: Its name after the camera's prefix.
        message_type: Its ROS type.
    """

    stream: str
    suffix: str
    message_type: type


CAMERA_TOPICS = (
    CameraTopic("colour", "colour/image", Image),
    CameraTopic("depth", "depth/image", Image),
    CameraTopic("segmentation", "segmentation", Image),
    CameraTopic("info", "colour/camera_info", CameraInfo),
    CameraTopic("info", "depth/camera_info", CameraInfo),
)


def camera_prefix(name: str, index: int) -> str:
    """Returns what the topics of a camera begin with: the first one's do not depend on its name."""
    return "rpbi/camera" if index == 0 else f"rpbi/{name}"
