"""The topics of a camera."""

from __future__ import annotations

from typing import NamedTuple

from sensor_msgs.msg import CameraInfo, Image, PointCloud2


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


IMAGE_TOPICS = (
    CameraTopic("colour", "colour/image", Image),
    CameraTopic("depth", "depth/image", Image),
    CameraTopic("segmentation", "segmentation", Image),
    CameraTopic("info", "colour/camera_info", CameraInfo),
    CameraTopic("info", "depth/camera_info", CameraInfo),
    CameraTopic("info", "camera_info", CameraInfo),  # that of `segmentation`, by the rule of image_transport
)
CLOUD_TOPIC = CameraTopic("points", "pointcloud", PointCloud2)


def camera_topics(topic_name: str, pointcloud: bool) -> dict[str, CameraTopic]:
    """Returns the topics of a camera by their relative names.

    Args:
        topic_name: What it is called in topics.
        pointcloud: Whether it has point clouds.
    """
    topics = (*IMAGE_TOPICS, CLOUD_TOPIC) if pointcloud else IMAGE_TOPICS
    return {f"rpbi/{topic_name}/{topic.suffix}": topic for topic in topics}
