"""Driving a base along a closed route of waypoints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

GAIN = 1.5
"""Speed for each metre or radian that is left [1/s]."""
REACHED_M = 0.03
"""A waypoint counts as reached within this distance [m]..."""
REACHED_RAD = 0.03
"""... and this angle [rad]."""


class PlanarPose(NamedTuple):
    """Where something stands on the floor.

    Attributes:
        x: Position [m].
        y: Position [m].
        yaw: Angle about the vertical [rad].
    """

    x: float
    y: float
    yaw: float


SQUARE = tuple(
    PlanarPose(0.8 * x, 0.8 * y, math.pi / 2.0 * turns)
    for x, y, turns in ((-1, -1, 0), (1, -1, 0), (1, 1, 1), (-1, 1, 1), (-1, 1, 2), (-1, -1, 3))
)
"""Ahead along the first side, turning along the second, sideways along the third, turning along the last again."""


class Route:
    """A route that begins again at its end.

    Args:
        waypoints: Where it leads.
    """

    def __init__(self, waypoints: Sequence[PlanarPose] = SQUARE) -> None:
        self._waypoints = tuple(waypoints)
        self._next = 0

    def velocity(self, pose: PlanarPose) -> PlanarPose:
        """Returns the velocity [m/s, m/s, rad/s] in its own frame with which a base goes on from a pose."""
        distance, angle = _left(pose, self._waypoints[self._next])
        if math.hypot(*distance) < REACHED_M and abs(angle) < REACHED_RAD:
            self._next = (self._next + 1) % len(self._waypoints)
            distance, angle = _left(pose, self._waypoints[self._next])
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        ahead, aside = cos * distance[0] + sin * distance[1], cos * distance[1] - sin * distance[0]
        return PlanarPose(GAIN * ahead, GAIN * aside, GAIN * angle)


def _left(pose: PlanarPose, goal: PlanarPose) -> tuple[tuple[float, float], float]:
    """Returns the way [m] and the shorter turn [rad] from a pose to another."""
    return (goal.x - pose.x, goal.y - pose.y), math.remainder(goal.yaw - pose.yaw, 2.0 * math.pi)
