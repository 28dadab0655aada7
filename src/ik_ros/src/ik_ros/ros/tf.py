"""TF with a limited age, and the frame of a solver's poses."""

import dataclasses
import time

import rospy
import tf2_ros

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.tf_interface import TfListener
from ik_ros.problem import IKProblem, Waypoint
from robot_model.geometry import Pose

from .messages import transform_in


class FreshTf:
    """The pose of one frame in another while TF is up to date.

    Age is measured in wall time, so TF of a stopped simulation is stale, too. Static transforms never are.

    Args:
        parent: The frame that poses are in.
        child: The frame.
        timeout_s: Largest age of a pose [s].
    """

    def __init__(self, parent: str, child: str, timeout_s: float) -> None:
        self._parent, self._child, self._timeout_s = parent, child, timeout_s
        self._stamp: rospy.Time | None = None
        self._changed_s = 0.0
        self._buffer = tf2_ros.Buffer()
        self._listener = TfListener(self._buffer)

    def pose(self) -> Pose:
        """Returns the newest pose.

        Raises:
            InterfaceError: If there is none, or it is too old.
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


class BaseFrame:
    """Transforms poses from other TF frames to a solver's base.

    Args:
        frame_id: TF frame of the base; if empty, poses are not transformed.
    """

    def __init__(self, frame_id: str) -> None:
        self._frame_id = frame_id.strip("/")
        if self._frame_id:
            self._buffer = tf2_ros.Buffer()
            self._listener = TfListener(self._buffer)

    def with_poses_in_it(self, problem: IKProblem, frame_id: str) -> IKProblem:
        """Returns a problem with its poses transformed from a TF frame to the base; an empty `frame_id` is the base.

        Raises:
            InterfaceError: If TF has no transform between the two frames.
        """
        frame_id = frame_id.strip("/")
        if not self._frame_id or frame_id in ("", self._frame_id):
            return problem
        try:
            transform = self._buffer.lookup_transform(self._frame_id, frame_id, rospy.Time(0)).transform
        except tf2_ros.TransformException as error:
            where = f"poses are in '{frame_id}', the solver's base is '{self._frame_id}'"
            raise InterfaceError(f"{where}: {error}") from None
        base = transform_in(transform)
        return dataclasses.replace(
            problem,
            target=None if problem.target is None else base @ problem.target,
            waypoints=tuple(Waypoint(one.time_s, base @ one.pose) for one in problem.waypoints),
        )
