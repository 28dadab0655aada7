"""Springs and dampers that stay stable at a tick's length, however stiff.

An explicit spring of stiffness k on a mass m oscillates, and then diverges, once k dt^2 / m is large. Here the spring
is evaluated where the joint will be after the tick, predicted from the mass matrix (Tan, Liu and Turk, "Stable
Proportional-Derivative Controllers", 2011) and an estimate of all other efforts on the joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from custom_ros_tools.errors import hint
from custom_ros_tools.schema import ConfigModel, Positive, Unit
from robot_model.geometry import Vector, scaled
from robot_model.linear_algebra import solve
from rpbi.urdf.joints import Joint

Array = npt.NDArray[np.float64]

DampingRatio = Annotated[float, Field(ge=0.0, le=2.0)]
SMOOTHED_S = 0.01
"""Time constant of the estimate of external efforts [s]."""
_EYE = np.eye(6)
ROUNDING = 1e-6 * np.eye(6)
"""Keeps the mobility of a singular arm invertible."""


class JointSprings(ConfigModel):
    """Springs and dampers at joints."""

    stiffness: Annotated[Positive, Unit("N m/rad or N/m")] | dict[str, Positive] = Field(
        500.0, description="For all joints, or by joint."
    )
    damping_ratio: DampingRatio | dict[str, DampingRatio] = Field(
        0.7, description="By the critical damping of each joint's inertia: of all joints, or by joint."
    )

    def by_joint(self, key: str, joints: Iterable[Joint]) -> Array:
        """Returns the values of a key for joints, its default where the joint is not named.

        Raises:
            ValueError: If a name is none of them.
        """
        given = getattr(self, key)
        names = [joint.name for joint in joints]
        if not isinstance(given, Mapping):
            return np.full(len(names), given)
        for name in given:
            if name not in names:
                raise ValueError(f"{key}: '{name}' is none of its joints{hint(name, names)}")
        default = type(self).model_fields[key].default
        return np.array([given.get(name, default) for name in names])


class Disturbance:
    """Estimates the acceleration of n joints by unmodelled effects, from the error of predicted positions.

    Args:
        count: Number of joints.
        dt_s: Length of a tick [s].
    """

    def __init__(self, count: int, dt_s: float) -> None:
        self.estimate = np.zeros(count)
        """n accelerations [rad/s^2 or m/s^2], smoothed by a first-order filter of 10 ms."""
        self._dt_s = dt_s
        self._share = (1.0 - math.exp(-dt_s / SMOOTHED_S)) / dt_s
        self._predicted: Array | None = None

    def update(self, velocity: Array) -> None:
        """Updates the estimate by the velocities [rad/s or m/s] after the tick of the last `predict`."""
        if self._predicted is not None:
            self.estimate += self._share * (velocity - self._predicted)

    def predict(self, velocity: Array, acceleration: Array) -> None:
        """Notes velocities before a tick, and the accelerations that are expected of it, with the estimate."""
        self._predicted = velocity + self._dt_s * acceleration


class JointImpedance:
    """Springs and dampers at n joints from tick to tick.

    Args:
        springs: Their stiffness and damping.
        joints: The n joints.
        dt_s: Length of a tick [s].

    Raises:
        ValueError: If the springs name a joint that is none of these.
    """

    def __init__(self, springs: JointSprings, joints: Sequence[Joint], dt_s: float) -> None:
        self._stiffness = springs.by_joint("stiffness", joints)
        self._damping = 2.0 * springs.by_joint("damping_ratio", joints) * np.sqrt(self._stiffness)
        self._dt_s = dt_s
        self.restart()

    def restart(self) -> None:
        """Resets the estimate of external efforts."""
        self._disturbance = Disturbance(len(self._stiffness), self._dt_s)

    def efforts(
        self, mass: Array, error: Array, velocity: Array, wanted_velocity: Array, push: Array | float = 0.0
    ) -> Array:
        """Returns n efforts [N m or N] for a tick, beyond those that balance gravity and motion.

        Args:
            mass: Mass matrix, shape (n, n).
            error: n position errors, desired less measured [rad or m].
            velocity: n measured velocities [rad/s or m/s].
            wanted_velocity: n desired velocities [rad/s or m/s].
            push: n efforts [N m or N] to add.
        """
        self._disturbance.update(velocity)
        external = mass @ self._disturbance.estimate
        damping = self._damping * np.sqrt(mass.diagonal())
        forces = self._stiffness * error + damping * wanted_velocity + (external + push)
        acceleration = implicit(mass, self._stiffness, damping, forces, velocity, self._dt_s)
        self._disturbance.predict(velocity, acceleration)
        efforts: Array = mass @ acceleration - external
        return efforts


def implicit(mass: Array, stiffness: Array, damping: Array, forces: Array, velocity: Array, dt_s: float) -> Array:
    """Returns how n joints accelerate [rad/s^2 or m/s^2] by springs and dampers, evaluated at the end of a tick.

    Args:
        mass: Mass matrix, shape (n, n).
        stiffness: n stiffnesses [N m/rad or N/m].
        damping: n dampings [N m s/rad or N s/m].
        forces: n efforts [N m or N] that act if the joints do not move, those of the springs among them.
        velocity: n velocities before the tick [rad/s or m/s].
        dt_s: Length of the tick [s].
    """
    by_velocity = damping + stiffness * dt_s
    stiff = mass.copy()
    stiff.reshape(-1)[:: len(mass) + 1] += by_velocity * dt_s
    return solve(stiff, forces - by_velocity * velocity)


def implicit_wrench(
    mobility: Array, stiffness: Array, damping: Array, wrench: Array, acceleration: Array, dt_s: float
) -> Array:
    """Returns force and moment of springs and dampers at a point of an arm, evaluated at the end of a tick.

    Args:
        mobility: Acceleration of the point by force, J M^-1 J^T, shape (6, 6).
        stiffness: 6 stiffnesses [N/m, N m/rad] along and about the axes of the springs.
        damping: 6 dampings [N s/m, N m s/rad].
        wrench: Force [N] and moment [N m] if the point did not move, shape (6,).
        acceleration: Acceleration of the point that results in its velocity within a tick, plus that by everything else
            that acts on the arm [m/s^2, rad/s^2], shape (6,).
        dt_s: Length of the tick [s].
    """
    by_acceleration = (damping + stiffness * dt_s) * dt_s
    given = wrench - by_acceleration * acceleration
    root = np.sqrt(by_acceleration)  # of (1 + by_acceleration mobility) x = given, for a symmetric matrix
    scaled_mobility = root[:, None] * mobility
    return given - root * solve(_EYE + scaled_mobility * root, scaled_mobility @ given)


def force_for(mobility: Array, acceleration: Array) -> Array:
    """Returns force and moment that result in an acceleration of a point [m/s^2, rad/s^2], shapes (6,).

    Args:
        mobility: Acceleration by force, shape (6, 6); of a singular arm it is not invertible but for a small part.
    """
    return solve(mobility + ROUNDING, acceleration)


def turn_between(start: Sequence[float], end: Sequence[float]) -> Vector:
    """Returns the rotation vector [rad] from one quaternion (x, y, z, w) to another, in the axes that both are in."""
    x, y, z, w = start
    a, b, c, d = end
    turn = a * w - d * x - b * z + c * y, b * w - d * y - c * x + a * z, c * w - d * z - a * y + b * x
    cosine, sine = d * w + a * x + b * y + c * z, math.hypot(*turn)
    scale = 2.0 * math.atan2(sine, abs(cosine)) / sine if sine > 1e-12 else 2.0
    return scaled(math.copysign(scale, cosine), turn)
