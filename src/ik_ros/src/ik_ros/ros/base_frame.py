"""The frame that a solver takes poses in."""

from __future__ import annotations

import dataclasses

import rospy
import tf2_ros

from custom_ros_tools.errors import InterfaceError

from ..problem import IKProblem, Waypoint
from .messages import transform_in


class BaseFrame:
    """Turns poses of other TF frames into those of a solver's base.

    Args:
        frame_id: TF frame of the base; empty takes all poses as they are.
    """

    def __init__(self, frame_id: str) -> None:
        self._frame_id = frame_id.strip("/")
        if self._frame_id:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)

    def with_poses_in_it(self, problem: IKProblem, frame_id: str) -> IKProblem:
        """Returns a problem with its poses in the base.

        Args:
            problem: The problem.
            frame_id: TF frame that its poses are in; empty is the base.

        Raises:
            InterfaceError: If TF does not know how the two frames lie.
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
