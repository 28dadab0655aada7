"""Reads transforms that are not too old, and transforms poses to a solver's base frame."""

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
    """Reads the pose of a TF frame in another frame, and rejects poses that are too old.

    A pose's age is the wall time since the transform's stamp last changed. So the poses from a paused simulation become
    too old as well. Static transforms are never too old.

    Args:
        parent: Name of the frame in which the pose is expressed.
        child: Name of the frame whose pose is read.
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
            InterfaceError: If TF does not have the transform, or the transform is too old.
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
    """Transforms the poses of problems to a solver's base frame.

    Args:
        frame_id: TF frame of the solver's base; if empty, poses are not transformed.
    """

    def __init__(self, frame_id: str) -> None:
        self._frame_id = frame_id.strip("/")
        if self._frame_id:
            self._buffer = tf2_ros.Buffer()
            self._listener = TfListener(self._buffer)

    def with_poses_in_it(self, problem: IKProblem, frame_id: str) -> IKProblem:
        """Returns the problem with target and waypoints transformed to the solver's base frame.

        Args:
            problem: The problem.
            frame_id: TF frame in which the problem's poses are expressed; empty for the base frame.

        Raises:
            InterfaceError: If TF does not have the transform between the two frames.
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
