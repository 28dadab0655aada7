"""`tracked_object_node.py`: turns detections by Vicon or an AprilTag detector into smooth TF frames of objects."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from functools import partial

import rospy
import tf2_ros
from apriltag_ros.msg import AprilTagDetectionArray
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import TransformStamped
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.tf_interface import TfListener
from custom_ros_tools.ros.transform_messages import as_pose, transform_message
from robot_model.geometry import Pose
from rpbi.engine.inputs import check_pose

from .config import TrackedObjectConfig, TrackingNodeConfig
from .tracker import PoseTracker

QUEUE_SIZE = 100
LOOKS_HZ = 10.0
"""Rate of the check for lost objects [Hz]."""


class TrackedObject:
    """Tracks one object, and logs when the object is seen and when it is lost."""

    def __init__(self, config: TrackedObjectConfig, node: TrackingNodeConfig) -> None:
        self.config = config
        self._timeout_s = node.timeout_s
        self.tracker = PoseTracker(node.smoothing, node.outliers, node.timeout_s)
        self._seen_s = -math.inf
        self._is_seen = False

    def note_seen(self) -> None:
        """Records that the object is visible now. Logs a message if the object was lost before."""
        self._seen_s = time.monotonic()
        if not self._is_seen:
            self._is_seen = True
            rospy.loginfo("%s: is seen", self.config.name)

    def tell_if_lost(self) -> None:
        """Logs a warning if no pose has arrived for `timeout_s`. Logs only one warning per loss."""
        if self._is_seen and time.monotonic() - self._seen_s > self._timeout_s:
            self._is_seen = False
            rospy.logwarn("%s: is lost: no pose for %g s; nothing is broadcast", self.config.name, self._timeout_s)


class TrackedObjectNode:
    """Broadcasts a TF frame for each object in `~config` while the object is seen.

    Raises:
        ConfigError: If the configuration is wrong.
    """

    def __init__(self) -> None:
        config = private_config(TrackingNodeConfig)
        self._frame_id = config.frame_id
        self._objects = [TrackedObject(each, config) for each in config.objects]
        by_tags: dict[str, dict[tuple[int, ...], TrackedObject]] = {}
        for each in self._objects:
            for topic in each.config.topics if each.config.tag_ids else ():
                by_tags.setdefault(topic, {})[each.config.tag_ids] = each
        self._warn = ThrottledWarning()
        self._buffer = tf2_ros.Buffer()
        self._listener = TfListener(self._buffer)
        self._publisher = rospy.Publisher("/tf", TFMessage, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        for each in self._objects:
            if each.config.vicon is not None:
                topic = f"vicon/{each.config.vicon.strip('/')}"
                self._subscribe(topic, TransformStamped, lambda message, each=each: self._on_vicon(each, message))
        for topic, by_ids in by_tags.items():
            self._subscribe(topic, AprilTagDetectionArray, partial(self._on_tags, by_ids))
        WallTimer(LOOKS_HZ, self._report_lost)

    def _subscribe(self, topic: str, message_type: type, on_message: object) -> None:
        rospy.Subscriber(topic, message_type, on_message, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _report_lost(self) -> None:
        for each in self._objects:
            each.tell_if_lost()

    def _on_vicon(self, tracked: TrackedObject, message: TransformStamped) -> None:
        self._observe(tracked, message.header, as_pose(message.transform))

    def _on_tags(self, by_ids: Mapping[tuple[int, ...], TrackedObject], message: AprilTagDetectionArray) -> None:
        for detection in message.detections:
            tracked = by_ids.get(_key(detection.id))
            if tracked is not None:
                stamped = detection.pose
                self._observe(tracked, stamped.header if stamped.header.frame_id else message.header, stamped.pose.pose)

    def _observe(self, tracked: TrackedObject, header: Header, message: PoseMessage) -> None:
        config = tracked.config
        try:
            frame_id = config.frame_id or header.frame_id.strip("/")  # vicon_bridge has slashes, invalid in tf2
            stamp = header.stamp or rospy.Time.now()
            pose = self._in_world(frame_id, stamp) @ _pose_in(message, config.unit) @ config.offset
            smoothed = tracked.tracker.observe(pose, stamp.to_sec())
        except tf2_ros.TransformException as error:
            self._warn(config.name, f"left out: no TF from '{self._frame_id}' to '{frame_id}': {error}")
            return
        except ValueError as error:
            self._warn(config.name, f"left out: {error}")
            return
        if smoothed is not None:
            tracked.note_seen()
            transform = TransformStamped(Header(0, stamp, self._frame_id), config.name, transform_message(*smoothed))
            self._publisher.publish(TFMessage([transform]))

    def _in_world(self, frame_id: str, stamp: rospy.Time) -> Pose:
        """Returns the pose of the frame `frame_id` in the configured parent frame, at time `stamp`.

        If TF does not cover this time, uses the newest transform.
        """
        if frame_id == self._frame_id:
            return Pose()
        try:
            found = self._buffer.lookup_transform(self._frame_id, frame_id, stamp)
        except tf2_ros.ExtrapolationException:
            found = self._buffer.lookup_transform(self._frame_id, frame_id, rospy.Time(0))
        return _pose_in(as_pose(found.transform), "m")


def _key(ids: Sequence[int]) -> tuple[int, ...]:
    return tuple(sorted(ids))


def _pose_in(message: PoseMessage, unit: str) -> Pose:
    """Returns the pose in a message, converted to metres. Raises a ValueError if the pose is invalid."""
    scale = 0.001 if unit == "mm" else 1.0
    p, q = message.position, message.orientation
    return check_pose(Pose((scale * p.x, scale * p.y, scale * p.z), (q.x, q.y, q.z, q.w)))


def main() -> None:
    """Runs the node."""
    run_node("tracked_object", TrackedObjectNode)
