"""Moves a link of an arm around the vertical axis of the arm's base. The link always points away from the axis."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from robot_model.geometry import Pose, Vector
from rpbi_examples.scenes.scene import Scene

from .arm import LedArm, about_z, smooth

SHORTEST_S = 0.5


class PolarPoint(NamedTuple):
    """A position in cylindrical coordinates about the z axis of the world.

    Attributes:
        radius: Distance from the axis [m].
        azimuth: Angle about the axis, from the world's x axis [rad].
        height: Height [m].
    """

    radius: float
    azimuth: float
    height: float

    @classmethod
    def of(cls, position: Vector) -> PolarPoint:
        """Returns the cylindrical coordinates of a position in the world [m]."""
        x, y, z = position
        return cls(math.hypot(x, y), math.atan2(y, x), z)

    def moved(self, out: float = 0.0, up: float = 0.0) -> PolarPoint:
        """Returns the position moved away from the axis by `out` and upwards by `up` [m]."""
        return PolarPoint(self.radius + out, self.azimuth, self.height + up)

    def pose(self) -> Pose:
        """Returns the pose in the world with this position, with x away from the axis and z up."""
        x, y = self.radius * math.cos(self.azimuth), self.radius * math.sin(self.azimuth)
        return Pose((x, y, self.height), about_z(self.azimuth))


class PolarArm(LedArm):
    """Moves a link of an arm whose base is on the z axis of the world. The link always points away from this axis.

    Args:
        scene: Scene in which the arm acts.
        robot: Name of the robot in the world.
        urdf: URDF file of the robot.
        base_link: First link of the kinematic chain.
        link: Last link of the kinematic chain, which is moved.
        base: Pose of `base_link` in the world.

    Attributes:
        spot: Last target position of the link.
    """

    def __init__(self, scene: Scene, robot: str, urdf: str, base_link: str, link: str, base: Pose) -> None:
        super().__init__(scene, robot, urdf, base_link, link, base)
        self.spot = PolarPoint.of(self.target.position)

    def swing(self, end: PolarPoint, speed: float, turn_speed: float) -> Iterator[None]:
        """Moves the link to a position, from rest to rest. Use: `yield from arm.swing(...)`.

        Args:
            end: Target position.
            speed: Largest mean speed in the plane of radius and height [m/s].
            turn_speed: Largest mean speed of the azimuth [rad/s].

        Raises:
            SceneFailedError: If a position on the path is out of reach.
        """
        start, begin_s = self.spot, self._scene.seen.time_s
        out, turn, up = (b - a for a, b in zip(start, end))
        duration_s = max(math.hypot(out, up) / speed, abs(turn) / turn_speed, SHORTEST_S)
        share = 0.0
        while share < 1.0:
            share = min((self._scene.seen.time_s - begin_s) / duration_s, 1.0)
            gone = smooth(share)
            self.spot = PolarPoint(start.radius + gone * out, start.azimuth + gone * turn, start.height + gone * up)
            self.send(self.spot.pose())
            yield
