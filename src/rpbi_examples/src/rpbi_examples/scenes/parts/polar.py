"""An arm that moves a link around the axis of its base; the link points away from the axis."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from robot_model.geometry import Pose, Vector
from rpbi_examples.scenes.scene import Scene

from .arm import LedArm, about_z, smooth

SHORTEST_S = 0.5


class PolarPoint(NamedTuple):
    """A place in cylindrical coordinates, whose axis is z of the world.

    Attributes:
        radius: Distance from the axis [m].
        azimuth: Angle about the axis, from x [rad].
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
        """Returns the position that is further out and higher [m]."""
        return PolarPoint(self.radius + out, self.azimuth, self.height + up)

    def pose(self) -> Pose:
        """Returns the pose in the world whose axis x points away from the axis, and z up."""
        x, y = self.radius * math.cos(self.azimuth), self.radius * math.sin(self.azimuth)
        return Pose((x, y, self.height), about_z(self.azimuth))


class PolarArm(LedArm):
    """Moves a link of an arm whose base is on the axis z of the world, without turning the wrist.

    Args:
        scene: The scene that it acts in.
        robot: The robot's name in the world.
        urdf: Its URDF.
        base_link: Link from which the chain begins.
        link: The link that is led.
        base: Pose of the base link in the world.

    Attributes:
        spot: The last position that the link was sent to.
    """

    def __init__(self, scene: Scene, robot: str, urdf: str, base_link: str, link: str, base: Pose) -> None:
        super().__init__(scene, robot, urdf, base_link, link, base)
        self.spot = PolarPoint.of(self.target.position)

    def swing(self, end: PolarPoint, speed: float, turn_speed: float) -> Iterator[None]:
        """Moves to a position, from rest to rest; used as `yield from arm.swing(...)`.

        Args:
            end: The position.
            speed: Mean speed out and up [m/s].
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
