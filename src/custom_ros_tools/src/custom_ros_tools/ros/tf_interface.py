"""`TfInterface`, which broadcasts, reads and converts transforms, and a TF listener that rejects invalid transforms."""

import math
import time
from collections.abc import Callable

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Transform, TransformStamped
from numpy.typing import ArrayLike
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.transforms import Array, matrix_of, pose_of, rpy_of

from .transform_messages import position_in, quat_in, transform_message

QUEUE_SIZE = 100
NORM_TOLERANCE = 0.01
"""Largest accepted deviation of a quaternion's squared length from 1, as in tf2."""
END_OF_TIME_S = 2**31
"""Stamp from which on transforms are rejected [s], since tf2 would read invalid memory and crash."""
NS_PER_S = 1_000_000_000
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)
POLL_S = 0.01


class TfListener:
    """Checks transforms from /tf and /tf_static, and stores the valid transforms in a buffer.

    `tf2_ros.TransformListener` does not check transforms. Some invalid transforms would crash the process in tf2. For
    every other invalid transform, tf2 would print two lines.

    Args:
        buffer: The buffer.
        noted: Function that is called with the child frame of each stored transform.
    """

    def __init__(self, buffer: tf2_ros.Buffer, noted: Callable[[str], None] = lambda _: None) -> None:
        self._noted = noted
        self._warn = ThrottledWarning()
        self._subscribers = [
            rospy.Subscriber(topic, TFMessage, self._on_message, store, queue_size=QUEUE_SIZE)
            for topic, store in (("/tf", buffer.set_transform), ("/tf_static", buffer.set_transform_static))
        ]

    def unregister(self) -> None:
        """Unsubscribes from /tf and /tf_static."""
        for subscriber in self._subscribers:
            subscriber.unregister()

    def _on_message(self, message: TFMessage, store: Callable[[TransformStamped, str], None]) -> None:
        sender = message._connection_header.get("callerid", "")
        for transform in message.transforms:
            fault = fault_in(transform)
            if fault is None:
                store(transform, sender)
                self._noted(transform.child_frame_id)
            else:
                self._warn(f"TF from {sender}", f"'{transform.child_frame_id}' refused: {fault}")


def fault_in(transform: TransformStamped) -> str | None:
    """Returns a description of a transform's first fault, or None if the transform is valid."""
    parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
    position, quat, stamp = transform.transform.translation, transform.transform.rotation, transform.header.stamp
    if not parent or not child or parent == child:
        return f"expected two frames, got '{parent}' and '{child}'"
    if not 0 <= stamp.secs + stamp.nsecs // NS_PER_S < END_OF_TIME_S:
        return f"expected a stamp before {END_OF_TIME_S} s, got {stamp.secs} s and {stamp.nsecs} ns"
    # A sum is finite only if all parts are finite. It may overflow for huge finite parts, which are invalid anyway.
    if not math.isfinite(position.x + position.y + position.z):
        return f"expected a finite translation, got {position.x:g}, {position.y:g}, {position.z:g}"
    norm = quat.x * quat.x + quat.y * quat.y + quat.z * quat.z + quat.w * quat.w
    if not abs(norm - 1.0) < NORM_TOLERANCE:
        return f"expected a quaternion of length 1, got {quat.x:g}, {quat.y:g}, {quat.z:g}, {quat.w:g}"
    return None


class TfInterface:
    """Broadcasts and receives TF transforms.

    A transform from parent to child is the pose of the child in the parent frame: position [m] and quaternion
    x, y, z, w. Create one object per node, after `rospy.init_node`. The object does not know transforms that were sent
    on /tf before its creation.
    """

    def __init__(self) -> None:
        self.tf_buffer = tf2_ros.Buffer()
        self.tf_broadcaster = tf2_ros.TransformBroadcaster()
        self._listener = TfListener(self.tf_buffer)

    def set_tf(
        self,
        parent_frame_id: str,
        child_frame_id: str,
        pos: ArrayLike,
        orientation: ArrayLike = NO_ROTATION,
        eul_deg: bool = False,
    ) -> None:
        """Broadcasts a transform with the current time as stamp.

        Args:
            parent_frame_id: Name of the parent frame.
            child_frame_id: Name of the child frame.
            pos: Position x, y, z of the child in the parent [m].
            orientation: Orientation of the child in the parent: quaternion x, y, z, w, or roll, pitch, yaw.
            eul_deg: Whether roll, pitch, yaw are in degrees instead of radians.
        """
        self.tf_broadcaster.sendTransform(self.pack_tf_msg(parent_frame_id, child_frame_id, pos, orientation, eul_deg))

    def set_matrix(self, parent_frame_id: str, child_frame_id: str, T: ArrayLike) -> None:
        """Broadcasts a transform that is given as a homogeneous matrix, shape (4, 4).

        Raises:
            ValueError: If the matrix is not a rigid transform.
        """
        self.set_tf(parent_frame_id, child_frame_id, *pose_of(T))

    def get_tf_msg(self, parent_frame_id: str, child_frame_id: str) -> TransformStamped | None:
        """Returns the newest transform; None if TF does not have the transform."""
        try:
            return self.tf_buffer.lookup_transform(parent_frame_id.strip("/"), child_frame_id.strip("/"), rospy.Time(0))
        except tf2_ros.TransformException:
            return None

    def get_tf(self, parent_frame_id: str, child_frame_id: str) -> tuple[Array, Array] | tuple[None, None]:
        """Returns position [m] and quaternion x, y, z, w of the newest transform; (None, None) without a transform."""
        return _pose(self.get_tf_msg(parent_frame_id, child_frame_id))

    def wait_for_tf_msg(
        self, parent_frame_id: str, child_frame_id: str, timeout: float | None = None
    ) -> TransformStamped | None:
        """Waits until TF has a transform between two frames, and returns the newest transform.

        Args:
            parent_frame_id: Name of the parent frame.
            child_frame_id: Name of the child frame.
            timeout: Longest time to wait, in wall time [s]; None waits without limit.

        Returns:
            The transform; None if TF does not have a transform in time.

        Raises:
            rospy.ROSInterruptException: If ROS shuts down during the wait.
        """
        start_s = time.monotonic()
        while not rospy.is_shutdown():
            message = self.get_tf_msg(parent_frame_id, child_frame_id)
            if message is not None or (timeout is not None and time.monotonic() - start_s > timeout):
                return message
            time.sleep(POLL_S)  # rospy.sleep would hang while simulated time is stopped
        raise rospy.ROSInterruptException(
            f"shut down while waiting for TF from '{parent_frame_id}' to '{child_frame_id}'"
        )

    def wait_for_tf(
        self, parent_frame_id: str, child_frame_id: str, timeout: float | None = None
    ) -> tuple[Array, Array] | tuple[None, None]:
        """Waits like `wait_for_tf_msg`, and returns position [m] and quaternion x, y, z, w; (None, None) at timeout."""
        return _pose(self.wait_for_tf_msg(parent_frame_id, child_frame_id, timeout))

    @staticmethod
    def pack_tf_msg(
        parent_frame_id: str,
        child_frame_id: str,
        pos: ArrayLike,
        rot: ArrayLike = NO_ROTATION,
        eul_deg: bool = False,
    ) -> TransformStamped:
        """Makes a transform message with the current time as stamp.

        Args:
            parent_frame_id: Name of the parent frame.
            child_frame_id: Name of the child frame.
            pos: Position x, y, z of the child in the parent [m].
            rot: Orientation of the child in the parent: quaternion x, y, z, w, or roll, pitch, yaw.
            eul_deg: Whether roll, pitch, yaw are in degrees instead of radians.

        Raises:
            ValueError: If the count of numbers is wrong, a number is not finite, or the quaternion is zero.
        """
        message = TransformStamped(child_frame_id=child_frame_id, transform=transform_message(pos, rot, eul_deg))
        message.header.frame_id = parent_frame_id
        message.header.stamp = rospy.Time.now()
        return message

    @staticmethod
    def pack_tf(pos: ArrayLike, rot: ArrayLike = NO_ROTATION, eul_deg: bool = False) -> Transform:
        """Makes a Transform message, which has neither frames nor stamp; for the arguments, see `pack_tf_msg`."""
        return transform_message(pos, rot, eul_deg)

    @staticmethod
    def tf_msg_to_pos(msg: Transform) -> Array:
        """Returns the position x, y, z [m] of a Transform."""
        return position_in(msg)

    @staticmethod
    def tf_msg_to_quat(msg: Transform) -> Array:
        """Returns the unit quaternion x, y, z, w of a Transform."""
        return quat_in(msg)

    @staticmethod
    def tf_msg_to_eul(msg: Transform) -> Array:
        """Returns roll, pitch, yaw [rad] of a Transform."""
        return rpy_of(quat_in(msg))

    @staticmethod
    def tf_msg_to_pos_magnitude(msg: Transform) -> float:
        """Returns the length of the translation in a Transform [m]."""
        return float(np.linalg.norm(position_in(msg)))

    @staticmethod
    def msg_to_pos(msg: TransformStamped) -> Array:
        """Returns the position x, y, z [m] of a TransformStamped."""
        return position_in(msg.transform)

    @staticmethod
    def msg_to_quat(msg: TransformStamped) -> Array:
        """Returns the unit quaternion x, y, z, w of a TransformStamped."""
        return quat_in(msg.transform)

    @staticmethod
    def msg_to_eul(msg: TransformStamped) -> Array:
        """Returns roll, pitch, yaw [rad] of a TransformStamped."""
        return TfInterface.tf_msg_to_eul(msg.transform)

    @staticmethod
    def msg_to_pos_magnitude(msg: TransformStamped) -> float:
        """Returns the length of the translation in a TransformStamped [m]."""
        return TfInterface.tf_msg_to_pos_magnitude(msg.transform)

    @staticmethod
    def msg_to_pos_quat(msg: TransformStamped) -> tuple[Array, Array]:
        """Returns position [m] and unit quaternion x, y, z, w of a TransformStamped."""
        return position_in(msg.transform), quat_in(msg.transform)

    @staticmethod
    def msg_to_pos_eul(msg: TransformStamped) -> tuple[Array, Array]:
        """Returns position [m] and roll, pitch, yaw [rad] of a TransformStamped."""
        return position_in(msg.transform), TfInterface.msg_to_eul(msg)

    @staticmethod
    def msg_to_matrix(msg: TransformStamped) -> Array:
        """Converts a TransformStamped to a homogeneous matrix, shape (4, 4)."""
        return matrix_of(position_in(msg.transform), quat_in(msg.transform))

    @staticmethod
    def pos_quat_to_matrix(pos: ArrayLike, quat: ArrayLike = NO_ROTATION) -> Array:
        """Converts a position [m] and a quaternion x, y, z, w to a homogeneous matrix, shape (4, 4)."""
        return matrix_of(pos, quat)


def _pose(message: TransformStamped | None) -> tuple[Array, Array] | tuple[None, None]:
    return (None, None) if message is None else TfInterface.msg_to_pos_quat(message)
