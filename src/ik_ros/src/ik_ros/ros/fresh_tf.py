"""TF that is known to be up to date."""

from __future__ import annotations

import time

import rospy
import tf2_ros

from custom_ros_tools.errors import InterfaceError
from rpbi.pose import Pose

from .messages import transform_in


class FreshTf:
    """The pose of one frame in another, as long as TF goes on.

    Wall time counts, so TF of a simulation that stands still is stale too. Static transforms never are.

    Args:
        parent: The frame that poses are in.
        child: The frame.
        timeout_s: How long a pose lasts when nothing new comes [s].
    """

    def __init__(self, parent: str, child: str, timeout_s: float) -> None:
        self._parent, self._child, self._timeout_s = parent, child, timeout_s
        self._stamp: rospy.Time | None = None
        self._changed_s = 0.0
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)

    def pose(self) -> Pose:
        """Returns the newest pose.

        Raises:
            InterfaceError: If there is none, or nothing new has come for too long.
        """
        try:
            message = self._buffer.lookup_transform(self._parent, self._child, rospy.Time(0))
        except tf2_ros.TransformException as error:
            raise InterfaceError(f"there is no TF from '{self._parent}' to '{self._child}': {error}") from None
        now_s = time.monotonic()
        if message.header.stamp != self._stamp:
            self._stamp, self._changed_s = message.header.stamp, now_s
        elif self._stamp and now_s - self._changed_s > self._timeout_s:
            age = f"for {now_s - self._changed_s:.1f} s"
            raise InterfaceError(f"TF from '{self._parent}' to '{self._child}' is stale: nothing new has come {age}")
        return transform_in(message.transform)
