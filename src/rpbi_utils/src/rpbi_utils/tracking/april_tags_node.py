"""`apriltag_node.py`: detects AprilTags in a camera's images. Uses the topic names and types of apriltag_ros."""

from __future__ import annotations

import numpy as np
import rospy
from apriltag_ros.msg import AprilTagDetection, AprilTagDetectionArray
from geometry_msgs.msg import Point, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion, TransformStamped
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image as ImageMessage
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.transform_messages import transform_message
from robot_model.geometry import Pose

from .config import AprilTagNodeConfig
from .tags import Image, TagDetector, tag_poses

QUEUE_SIZE = 10
CHANNELS = {"mono8": 1, "rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4}
LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in a grey value (ITU-R BT.601)."""


def grey_image(message: ImageMessage) -> Image:
    """Converts an image message to grey bytes, shape (rows, columns).

    Raises a ValueError if the encoding is unsupported or the size of the data is wrong.
    """
    channels = CHANNELS.get(message.encoding)
    if channels is None:
        raise ValueError(f"expected an image in {', '.join(CHANNELS)}, got '{message.encoding}'")
    if message.step < message.width * channels or len(message.data) != message.step * message.height:
        raise ValueError(f"expected {message.height} rows of {message.step} bytes, got {len(message.data)} bytes")
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)[:, : message.width * channels]
    if channels == 1:
        return np.ascontiguousarray(rows)
    colours = rows.reshape(message.height, message.width, channels)[:, :, :3]
    if message.encoding.startswith("bgr"):
        colours = colours[:, :, ::-1]
    return (colours @ LUMA).round().astype(np.uint8)


class AprilTagNode:
    """Detects tags in images on `image_rect`, and publishes the tags' poses. The camera matrix is on `camera_info`.

    Raises:
        ConfigError: If the configuration is wrong.
    """

    def __init__(self) -> None:
        config = private_config(AprilTagNodeConfig)
        self._sizes = {tag.id: tag.size for tag in config.standalone_tags}
        self._names = {tag.id: tag.name or f"tag_{tag.id}" for tag in config.standalone_tags}
        self._detector = TagDetector()
        self._camera_matrix: np.ndarray | None = None
        self._warn = ThrottledWarning()
        self._publisher = rospy.Publisher("tag_detections", AprilTagDetectionArray, queue_size=QUEUE_SIZE)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=QUEUE_SIZE) if config.publish_tf else None
        self._image_topic = rospy.resolve_name("image_rect")
        rospy.Subscriber("camera_info", CameraInfo, self._on_calibration, queue_size=1)
        rospy.Subscriber(self._image_topic, ImageMessage, self._on_image, queue_size=1, buff_size=2**24)

    def _on_calibration(self, message: CameraInfo) -> None:
        matrix = np.array(message.P).reshape(3, 4)[:, :3]
        if not np.isfinite(matrix).all() or matrix[0, 0] <= 0.0 or matrix[1, 1] <= 0.0:
            self._warn(rospy.resolve_name("camera_info"), f"message refused: no focal length in P, got {message.P}")
            return
        self._camera_matrix = matrix

    def _on_image(self, message: ImageMessage) -> None:
        if self._camera_matrix is None:
            self._warn(self._image_topic, f"images wait for {rospy.resolve_name('camera_info')}")
            return
        try:
            found = list(tag_poses(self._detector, grey_image(message), self._camera_matrix, self._sizes))
        except ValueError as error:
            self._warn(self._image_topic, f"message refused: {error}")
            return
        header = message.header
        detections = [self._detection(number, pose, header) for number, pose in found]
        self._publisher.publish(AprilTagDetectionArray(header, detections))
        if self._tf is not None and found:
            self._tf.publish(
                TFMessage([TransformStamped(header, self._names[tag], transform_message(*pose)) for tag, pose in found])
            )

    def _detection(self, number: int, pose: Pose, header: Header) -> AprilTagDetection:
        message = PoseWithCovariance(pose=PoseMessage(Point(*pose.position), Quaternion(*pose.quat_xyzw)))
        return AprilTagDetection([number], [self._sizes[number]], PoseWithCovarianceStamped(header, message))


def main() -> None:
    """Runs the node."""
    run_node("apriltag", AprilTagNode)
