"""Markers for RViz: the closest points of shapes near each other, and the boxes that links must not leave."""

import math
from collections.abc import Iterator
from threading import Condition

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from safe_robot.checks.environment import Environment
from safe_robot.checks.link_box import BoxConfig, LinkBox
from safe_robot.checks.self_collision import SelfCollision
from safe_robot.guard import Guard

HZ = 10.0
WITHIN_M = 0.15
"""Pairs that are further apart are not shown [m]."""
TEXT_M, STEEP = 0.03, 0.5
"""Height of the letters [m], and ratio of horizontal to vertical length below which a line counts as vertical."""
UNLIMITED_M = 2.0
"""Coordinate, positive or negative, at which an unlimited side of a box is drawn [m]."""
NEAR, TOO_NEAR, BOX = ColorRGBA(1.0, 0.8, 0.0, 1.0), ColorRGBA(1.0, 0.0, 0.0, 1.0), ColorRGBA(0.2, 0.5, 1.0, 0.15)


class GuardMarkers:
    """Publishes markers of near pairs of shapes and of the boxes that links must not leave.

    The topic `robot_safety/markers` shows pairs and boxes, and `safe_robot/box_limit/marker` shows only boxes. A topic
    without subscribers gets no messages.

    Args:
        guard: The guard.
        lock: Held while the guard is used.
        frame: TF frame of the robot's root.
    """

    def __init__(self, guard: Guard, lock: Condition, frame: str) -> None:
        self._guard, self._lock, self._frame = guard, lock, frame
        self._publisher = rospy.Publisher("robot_safety/markers", MarkerArray, queue_size=10, latch=True)
        self._box = rospy.Publisher("safe_robot/box_limit/marker", Marker, queue_size=10)
        self._timer = WallTimer(HZ, self._publish)

    def close(self) -> None:
        """Stops the timer, and closes the topics."""
        self._timer.stop()
        self._publisher.unregister()
        self._box.unregister()

    def _publish(self) -> None:
        if self._box.get_num_connections():
            for box in self._boxes():
                self._box.publish(box)
        if not self._publisher.get_num_connections():
            return
        with self._lock:
            q = self._guard.last_command
            markers = [] if q is None else [*self._lines(np.array(q))]
        self._publisher.publish([self._marker("", 0, Marker.CUBE, action=Marker.DELETEALL), *markers, *self._boxes()])

    def _lines(self, q: np.ndarray) -> Iterator[Marker]:
        """Yields two markers for each near pair: a line between the closest points, and the distance as text."""
        for check in self._guard.checks:
            if not isinstance(check, (SelfCollision, Environment)):
                continue
            for i, (_, contact) in enumerate(check.proximity.contacts(q, WITHIN_M)):
                color = NEAR if contact.distance > 2.0 * check.config.margin_m else TOO_NEAR
                ends = [Point(*contact.first), Point(*contact.second)]
                line = self._marker(check.name, 2 * i, Marker.LINE_LIST, points=ends, color=color)
                line.scale.x = 0.004
                yield line
                text = self._marker(check.name, 2 * i + 1, Marker.TEXT_VIEW_FACING, color=color)
                text.pose.position = Point(*_beside(np.array(contact.first), np.array(contact.second)))
                text.scale.z, text.text = TEXT_M, f"{1e3 * contact.distance:.0f} mm"
                yield text

    def _boxes(self) -> Iterator[Marker]:
        boxes = [each for check in self._guard.checks if isinstance(check, LinkBox) for each in _boxes_of(check)]
        for i, box in enumerate(boxes):
            low, high = np.array([_ends(axis) for axis in (box.x, box.y, box.z)]).T
            marker = self._marker("link_box", i, Marker.CUBE, color=BOX, scale=Vector3(*(high - low)))
            marker.pose.position = Point(*((low + high) / 2.0))
            yield marker

    def _marker(self, namespace: str, number: int, kind: int, **fields: object) -> Marker:
        marker = Marker(ns=namespace, id=number, type=kind, **fields)
        marker.header.frame_id = self._frame
        marker.pose = Pose(orientation=Quaternion(w=1.0))
        return marker


def _beside(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Returns the middle of a text next to a line, at the height of the line's middle, shape (3,) [m]."""
    x, y, z = second - first
    across = np.array((-y, x, 0.0)) if math.hypot(x, y) > STEEP * abs(z) else np.array((0.0, 1.0, 0.0))
    return (first + second) / 2.0 + 3.0 * TEXT_M * across / np.linalg.norm(across)


def _boxes_of(check: LinkBox) -> list[BoxConfig]:
    return list(check.config.boxes.values())


def _ends(axis: tuple[float | None, float | None]) -> tuple[float, float]:
    low, high = axis
    return -UNLIMITED_M if low is None else low, UNLIMITED_M if high is None else high
