"""Follows TF frames: what they say goes into the world, and what is wrong with them is said now and then."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from custom_ros_tools.errors import InterfaceError, PluginError
from custom_ros_tools.plugins import cause_of, full_name
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose
from rpbi.plugins import is_foreign

from .headers import world_frame

TF_MISSING_AFTER_S = 5.0
"""How long a TF frame may be missing before that is worth a warning [s] of wall time."""
LONGEST_NAP_S = 0.1
"""How soon a new frame to follow is noticed [s] of wall time."""
QUEUE_SIZE = 100
NORM_TOLERANCE = 0.01
"""How far the square of a quaternion's length may be from 1, as for tf2."""


class TfListener:
    """What is known of TF; `tf2_ros.TransformListener` does the same without looking at what comes.

    tf2 refuses by itself what is no transform, but prints two lines on the console each time, however often it comes.
    """

    def __init__(self) -> None:
        self._buffer = tf2_ros.Buffer()
        self._warn = ThrottledWarning()
        rospy.Subscriber("/tf", TFMessage, self._take, self._buffer.set_transform, queue_size=QUEUE_SIZE)
        rospy.Subscriber("/tf_static", TFMessage, self._take, self._buffer.set_transform_static, queue_size=QUEUE_SIZE)

    def pose(self, parent: str, child: str) -> Pose | None:
        """Returns the newest pose of a frame in another, None if there is none."""
        try:
            transform = self._buffer.lookup_transform(parent, child, rospy.Time(0)).transform
        except tf2_ros.TransformException:
            return None
        position, quat = transform.translation, transform.rotation
        return Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))

    def _take(self, message: TFMessage, store: Callable[[TransformStamped, str], None]) -> None:
        sender = message._connection_header.get("callerid", "")
        for transform in message.transforms:
            fault = fault_in(transform)
            if fault is None:
                store(transform, sender)
            else:
                self._warn(f"TF from {sender}", f"'{transform.child_frame_id}' refused: {fault}")


def fault_in(transform: TransformStamped) -> str | None:
    """Returns what is wrong with a transform, None if nothing is."""
    parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
    position, quat = transform.transform.translation, transform.transform.rotation
    if not parent or not child or parent == child:
        return f"expected two frames, got '{parent}' and '{child}'"
    # A sum is finite only if all of its parts are, unless they are far beyond any scene.
    if not math.isfinite(position.x + position.y + position.z):
        return f"expected a finite translation, got {position.x:g}, {position.y:g}, {position.z:g}"
    norm = quat.x * quat.x + quat.y * quat.y + quat.z * quat.z + quat.w * quat.w
    if not abs(norm - 1.0) < NORM_TOLERANCE:
        return f"expected a quaternion of length 1, got {quat.x:g}, {quat.y:g}, {quat.z:g}, {quat.w:g}"
    return None


def refusal(slot: str, taken: Input, error: Exception) -> Exception:
    """Returns why a value is refused: what its check says, or what went wrong in another package.

    Raises:
        Exception: The error, if it is a bug of this package.
    """
    if isinstance(error, (InterfaceError, ValueError)):
        return error
    if is_foreign(taken.apply):
        return PluginError(full_name(taken.apply), f"taking '{slot}'", cause_of(error))
    raise error


class _Followed:
    """A pose input and what is known of its frame."""

    def __init__(self, name: str, slot: str, pose_input: PoseInput) -> None:
        self.name, self.slot, self.pose_input = name, slot, pose_input
        self.tf_id = pose_input.tf_id
        self.period_s = 1.0 / pose_input.hz
        self.due_s = self.since_s = time.monotonic()
        self.last_pose: Pose | None = None


class TfFollower:
    """Looks up the TF frames that poses follow, in one thread, by wall time.

    It listens to TF only once there is something to follow.
    """

    def __init__(self, put: Callable[[str, Any], None]) -> None:
        self._put = put
        self._followed: tuple[_Followed, ...] = ()
        self._listener: TfListener | None = None
        self._warn = ThrottledWarning(period_s=30.0)

    def follow(self, name: str, slot: str, pose_input: PoseInput) -> None:
        """Begins to follow a frame for a body or sensor."""
        self._followed = (*self._followed, _Followed(name, slot, pose_input))
        if self._listener is None:
            self._listener = TfListener()
            threading.Thread(target=self._run, args=(self._listener,), name="tf follower", daemon=True).start()

    def leave(self, name: str) -> None:
        """Follows nothing for a body or sensor any more."""
        self._followed = tuple(followed for followed in self._followed if followed.name != name)

    def repeat(self) -> None:
        """Puts all last poses again."""
        for followed in self._followed:
            if followed.last_pose is not None:
                with contextlib.suppress(Exception):  # gone meanwhile, or refused as it was before
                    self._put(followed.slot, followed.last_pose)

    def _run(self, listener: TfListener) -> None:
        while not rospy.is_shutdown():
            followed = self._followed
            now_s = time.monotonic()
            for each in followed:
                if now_s >= each.due_s:
                    each.due_s = now_s + each.period_s
                    self._look(listener, each, now_s)
            next_s = min((each.due_s for each in followed), default=now_s + LONGEST_NAP_S)
            time.sleep(min(max(next_s - time.monotonic(), 0.001), LONGEST_NAP_S))

    def _look(self, listener: TfListener, followed: _Followed, now_s: float) -> None:
        pose = listener.pose(world_frame(), followed.tf_id)
        if pose is None:
            if followed.last_pose is None and now_s - followed.since_s > TF_MISSING_AFTER_S:
                self._warn(
                    followed.slot, f"no TF from '{world_frame()}' to '{followed.tf_id}' so far; it stays where it is"
                )
        elif pose != followed.last_pose:
            followed.last_pose = pose
            try:
                self._put(followed.slot, pose)
            except Exception as error:
                reason = refusal(followed.slot, followed.pose_input, error)
                if followed in self._followed:  # else it has gone meanwhile
                    self._warn(followed.slot, f"TF refused: {reason}")
