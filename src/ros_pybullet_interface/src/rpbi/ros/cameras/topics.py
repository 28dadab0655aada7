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
        meaning: What it tells, in a sentence.
    """

    stream: str
    suffix: str
    message_type: type
    meaning: str


IMAGE_TOPICS = (
    CameraTopic("colour", "colour/image", Image, "Colour, `rgb8`."),
    CameraTopic(
        "depth",
        "depth/image",
        Image,
        "Distance along the optical axis, `32FC1` [m]; the far end of `range` where nothing is.",
    ),
    CameraTopic(
        "segmentation", "segmentation", Image, "PyBullet's ids of the bodies, `mono16`; 65535 where nothing is."
    ),
    CameraTopic("info", "colour/camera_info", CameraInfo, "Intrinsics of the colour image."),
    CameraTopic("info", "depth/camera_info", CameraInfo, "Intrinsics of the depth image."),
    # By the rule of image_transport
    CameraTopic("info", "camera_info", CameraInfo, "Intrinsics of the segmentation."),
)
CLOUD_TOPIC = CameraTopic(
    "points",
    "pointcloud",
    PointCloud2,
    "Points `x`, `y`, `z` [m] in the optical frame and `rgb`, one a pixel, NaN where nothing is; with `pointcloud`.",
)


def camera_topics(topic_name: str, pointcloud: bool) -> dict[str, CameraTopic]:
    """Returns the topics of a camera by their relative names.

    Args:
        topic_name: What it is called in topics.
        pointcloud: Whether it has point clouds.
    """
    topics = (*IMAGE_TOPICS, CLOUD_TOPIC) if pointcloud else IMAGE_TOPICS
    return {f"rpbi/{topic_name}/{topic.suffix}": topic for topic in topics}
