"""Couplings: accelerations that are added to an executed motion, to yield to forces or to avoid obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from custom_ros_tools.transforms import Array, finite_vector

from .dynamics import MotionState, SpringDamper

STEEPNESS = 20.0 / math.pi
"""Rate at which the avoidance decays with the angle between velocity and obstacle [1/rad] (Hoffmann 2009)."""
SLOWEST_M_S = 1e-6
"""Speed below which the direction of a motion counts as undefined [m/s]."""


@dataclass
class ForceCoupling:
    """Lets a motion yield to a force like a spring: a constant force shifts the motion by force / stiffness.

    Attributes:
        stiffness: Stiffness in each coordinate, shape (dof,), or one number for all coordinates [N/m or N m/rad].
        force: Measured force on the moved object, shape (dof,) [N or N m]. Callers update it at each measurement.
    """

    stiffness: ArrayLike
    force: ArrayLike = 0.0

    def __post_init__(self) -> None:
        if not (np.asarray(self.stiffness, dtype=float) > 0.0).all():
            raise ValueError(f"stiffness: expected numbers above 0, got {self.stiffness!r}")

    def __call__(self, state: MotionState, spring: SpringDamper) -> Array:
        """Returns the acceleration to add, shape (dof,) [m/s^2 or rad/s^2]."""
        given_way = np.asarray(self.force, dtype=float) / np.asarray(self.stiffness, dtype=float)
        return np.asarray(spring.stiffness * np.broadcast_to(given_way, state.velocity.shape))


@dataclass
class ObstacleCoupling:
    """Steers the first three positions of a motion around a ball (Hoffmann 2009, equation 8).

    The velocity is turned away from the ball. The avoidance decays with the angle between the velocity and the ball's
    edge, and with the distance from the ball's surface.

    Attributes:
        center: Centre of the ball x, y, z [m]. Callers update it when the ball moves.
        radius_m: Radius of the ball [m].
        range_m: Distance from the ball's surface at which the avoidance has fallen to 37 % [m].
        gain: Strength of the avoidance, 1000 in the paper.
    """

    center: ArrayLike
    radius_m: float = 0.05
    range_m: float = 0.1
    gain: float = 1000.0
    _side: Array = field(default_factory=lambda: np.zeros(3), repr=False)

    def __post_init__(self) -> None:
        self.center = finite_vector(self.center, 3, "center")
        for name in ("radius_m", "range_m", "gain"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name}: expected a number above 0, got {getattr(self, name)}")

    def __call__(self, state: MotionState, spring: SpringDamper) -> Array:
        """Returns the acceleration to add, shape (dof,) [m/s^2 or rad/s^2]."""
        evasion = np.zeros_like(state.velocity)
        velocity, to_center = state.velocity[:3], np.asarray(self.center, dtype=float) - state.point[:3]
        speed, distance = float(np.linalg.norm(velocity)), float(np.linalg.norm(to_center))
        if speed < SLOWEST_M_S or distance < SLOWEST_M_S:
            return evasion
        heading = velocity / speed
        angle = math.acos(min(max(float(heading @ to_center) / distance, -1.0), 1.0))
        if angle > 0.5 * math.pi:  # the motion has passed the ball
            return evasion
        away = heading * float(heading @ to_center) - to_center  # across the motion
        if np.linalg.norm(away) < 1e-6 * distance:  # straight towards the centre: always choose the same side
            away = np.cross(heading, np.eye(3)[int(np.argmin(np.abs(heading)))])
        seen = math.asin(min(self.radius_m / distance, 1.0))
        beside = max(angle - seen, 1.0 / STEEPNESS)
        strength = self.gain / spring.duration_s * speed * beside * math.exp(-STEEPNESS * beside)
        strength *= math.exp(-max(distance - self.radius_m, 0.0) / self.range_m)
        evasion[:3] = strength * away / np.linalg.norm(away)
        return evasion
