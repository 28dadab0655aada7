"""Velocities in a plane, and how fast they may be and change."""

from __future__ import annotations

import math
from typing import NamedTuple

from rpbi.geometry import Twist

ROUNDING = 1e-6
"""Components out of the plane up to this count as zero [m/s, rad/s]."""


class PlanarVelocity(NamedTuple):
    """Velocity of a base in its plane.

    Attributes:
        x: Forwards [m/s], in the base frame unless said otherwise.
        y: To the left [m/s].
        yaw: Counter-clockwise [rad/s].
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @classmethod
    def checked(cls, twist: Twist) -> PlanarVelocity:
        """Returns what a twist asks of a base that stays in its plane.

        Raises:
            ValueError: If a number is not finite or points out of the plane; it names what does.
        """
        given = {
            f"{part}.{axis}": value
            for part, vector in twist._asdict().items()
            for axis, value in zip("xyz", vector, strict=True)
        }
        bad = [f"{key}={value}" for key, value in given.items() if not math.isfinite(value)]
        if bad:
            raise ValueError(f"velocities must be finite, got {', '.join(bad)}")
        bad = [f"{key}={given[key]:g}" for key in ("linear.z", "angular.x", "angular.y") if abs(given[key]) > ROUNDING]
        if bad:
            raise ValueError(f"a planar base has linear.x, linear.y and angular.z alone, got {', '.join(bad)}")
        return cls(given["linear.x"], given["linear.y"], given["angular.z"])

    def turned(self, yaw: float) -> PlanarVelocity:
        """Returns the same velocity expressed in a frame in which the present one stands at an angle [rad]."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        return PlanarVelocity(cos * self.x - sin * self.y, sin * self.x + cos * self.y, self.yaw)

    def limited(self, linear: float, angular: float) -> PlanarVelocity:
        """Returns it with at most a speed [m/s] and a rotation [rad/s]; its direction stays."""
        speed = math.hypot(self.x, self.y)
        share = min(1.0, linear / speed) if speed else 1.0
        return PlanarVelocity(self.x * share, self.y * share, min(max(self.yaw, -angular), angular))

    def towards(self, goal: PlanarVelocity, linear: float, angular: float) -> PlanarVelocity:
        """Returns it after a change to a goal by at most so much [m/s and rad/s]."""
        change = PlanarVelocity(goal.x - self.x, goal.y - self.y, goal.yaw - self.yaw).limited(linear, angular)
        return PlanarVelocity(self.x + change.x, self.y + change.y, self.yaw + change.yaw)
