"""Shows planned motions in RViz: the path of a link, the goal, and a ghost of the robot that moves along the path."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from rpbi.bodies.robots.robot import Robot
from rpbi.bodies.visual_shapes import BodyShape, body_shapes
from rpbi.ros.publishers.world_markers import shape_marker

GHOST_HZ = 15.0
"""Rate of the ghost's motion [Hz]."""
PAUSE_S = 1.0
"""Time for which the ghost rests at the goal before it starts again [s]."""
GHOST, GOAL = (0.15, 0.45, 0.85, 0.45), (0.18, 0.62, 0.32, 0.35)
"""Colours of the moving ghost and of the robot at the goal."""
PATH, PATH_M = ColorRGBA(0.15, 0.45, 0.85, 1.0), 0.008
"""Colour and width of the path [m]."""
POINTS = 100
"""Number of points of the path."""


class PlanMarkers:
    """Publishes path and goal of the newest plan on `planner/markers`, and the moving ghost on `planner/ghost`."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("planner/markers", MarkerArray, queue_size=2, latch=True)
        self._ghost_publisher = rospy.Publisher("planner/ghost", MarkerArray, queue_size=2)
        self._ghost: _Ghost | None = None
        self._trajectory: Any = None
        self._begin_s = 0.0
        WallTimer(GHOST_HZ, self._move_ghost)

    def show(
        self, robot: Robot, base: Pose, start: Mapping[str, float], plan: Any, link: str, world_frame: str
    ) -> None:
        """Shows a plan until the next one.

        Args:
            robot: The robot.
            base: Pose of the robot's root link in the world.
            start: Positions of all joints at the start [rad or m], indexed by joint.
            plan: Result of `rpbi_planning.plan`.
            link: Link whose path is shown.
            world_frame: TF frame of the world.
        """
        ghost = _Ghost(robot, base, start, plan.joint_names, world_frame)
        at_s = np.linspace(0.0, plan.trajectory.duration_s, POINTS)
        places = [ghost.link_pose(_positions(plan.trajectory, each), link).position for each in at_s]
        path = Marker(ns="path", type=Marker.LINE_STRIP, action=Marker.ADD, color=PATH)
        path.header.frame_id = world_frame
        path.pose.orientation.w, path.scale.x = 1.0, PATH_M
        path.points = [Point(*place) for place in places]
        goal = ghost.markers("goal", _positions(plan.trajectory, at_s[-1]), GOAL)
        clear = Marker(action=Marker.DELETEALL)
        clear.header.frame_id = world_frame
        self._publisher.publish(MarkerArray([clear, path, *goal]))
        self._ghost, self._trajectory, self._begin_s = ghost, plan.trajectory, time.monotonic()

    def hide_ghost(self) -> None:
        """Removes the moving ghost, since the robot itself moves."""
        ghost, self._ghost = self._ghost, None
        if ghost is not None:
            gone = ghost.markers("ghost", _positions(self._trajectory, 0.0), GHOST)
            for marker in gone:
                marker.action = Marker.DELETE
            self._ghost_publisher.publish(MarkerArray(gone))

    def _move_ghost(self) -> None:
        ghost, trajectory = self._ghost, self._trajectory
        if ghost is None or not self._ghost_publisher.get_num_connections():
            return
        elapsed_s = (time.monotonic() - self._begin_s) % (trajectory.duration_s + PAUSE_S)
        positions = _positions(trajectory, min(elapsed_s, trajectory.duration_s))
        self._ghost_publisher.publish(MarkerArray(ghost.markers("ghost", positions, GHOST)))


class _Ghost:
    """Shapes of a robot at any positions of its joints."""

    def __init__(
        self, robot: Robot, base: Pose, start: Mapping[str, float], joint_names: Sequence[str], world_frame: str
    ) -> None:
        self._model = RobotModel(robot.config.loadURDF.fileName)
        self._base, self._frame = base, world_frame
        self._start = [start.get(name, 0.0) for name in self._model.joint_names]
        self._columns = [self._model.joint_names.index(name) for name in joint_names]
        self._shapes: list[BodyShape] = body_shapes(robot)

    def link_pose(self, positions: Sequence[float], link: str) -> Pose:
        """Returns the pose of a link in the world."""
        return self._base @ self._model.pose(self._all(positions), link)

    def markers(
        self, namespace: str, positions: Sequence[float], rgba: tuple[float, float, float, float]
    ) -> list[Marker]:
        """Returns a marker for each shape.

        Args:
            namespace: Namespace of the markers.
            positions: Positions of the planned joints [rad or m].
            rgba: Colour of all markers.
        """
        q = self._all(positions)
        poses = {link: self._base @ self._model.pose(q, link) for link in {each.link for each in self._shapes}}
        found = []
        for number, shape in enumerate(self._shapes):
            shown = shape._replace(rgba=rgba, is_textured=False)
            marker = shape_marker(namespace, number, shown, self._frame, poses[shape.link] @ shape.pose_in_link)
            marker.frame_locked = False
            found.append(marker)
        return found

    def _all(self, positions: Sequence[float]) -> list[float]:
        q = list(self._start)
        for column, position in zip(self._columns, positions):
            q[column] = float(position)
        return q


def _positions(trajectory: Any, time_s: float) -> list[float]:
    return [float(np.interp(time_s, trajectory.times, column)) for column in np.asarray(trajectory.positions).T]
