"""Springs and dampers that stay stable for any stiffness at the simulation's time step.

With explicit integration, a spring of stiffness k on a mass m diverges if k dt^2 / m is large. Here the spring force is
computed for the joint position at the end of the tick. That position is predicted from the mass matrix (Tan, Liu and
Turk, "Stable Proportional-Derivative Controllers", 2011) and from an estimate of the external efforts.
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
"""Time constant [s] of the low-pass filter on the estimated disturbance."""
_EYE = np.eye(6)
ROUNDING = 1e-6 * np.eye(6)
"""Added to the mobility matrix so that the matrix is invertible at singular arm configurations."""


class JointSprings(ConfigModel):
    """Stiffness and damping ratio of springs and dampers at joints."""

    stiffness: Annotated[Positive, Unit("N m/rad or N/m")] | dict[str, Positive] = Field(
        500.0, description="Stiffness: one number for all joints, or a mapping from joint names to numbers."
    )
    damping_ratio: DampingRatio | dict[str, DampingRatio] = Field(
        0.7,
        description="Damping, as a fraction of the critical damping for each joint's inertia: one number for all "
        "joints, or a mapping from joint names to numbers.",
    )

    def by_joint(self, key: str, joints: Iterable[Joint]) -> Array:
        """Returns the stiffnesses or damping ratios of n joints, shape (n,): configured values or defaults.

        Args:
            key: `stiffness` or `damping_ratio`.
            joints: The n joints, in the order of the result.

        Raises:
            ValueError: If the configuration names a joint that is not in `joints`.
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
    """Estimates how unmodelled effects accelerate n joints, from the errors of predicted velocities.

    Args:
        count: Number n of joints.
        dt_s: Length of a tick [s].
    """

    def __init__(self, count: int, dt_s: float) -> None:
        self.estimate = np.zeros(count)
        """Estimated accelerations [rad/s^2 or m/s^2] of the n joints, smoothed by a first-order filter."""
        self._dt_s = dt_s
        self._share = (1.0 - math.exp(-dt_s / SMOOTHED_S)) / dt_s
        self._predicted: Array | None = None

    def update(self, velocity: Array) -> None:
        """Corrects the estimate by the error of the last prediction.

        Args:
            velocity: n measured velocities [rad/s or m/s] after the tick of the last `predict`.
        """
        if self._predicted is not None:
            self.estimate += self._share * (velocity - self._predicted)

    def predict(self, velocity: Array, acceleration: Array) -> None:
        """Predicts the velocities at the end of a tick, for the next `update`.

        Args:
            velocity: n velocities [rad/s or m/s] before the tick.
            acceleration: n expected accelerations [rad/s^2 or m/s^2] during the tick, including `estimate`.
        """
        self._predicted = velocity + self._dt_s * acceleration


class JointImpedance:
    """Computes the efforts of springs and dampers at n joints at each tick.

    Args:
        springs: Stiffness and damping ratio of the springs and dampers.
        joints: The n joints.
        dt_s: Length of a tick [s].

    Raises:
        ValueError: If `springs` names a joint that is not in `joints`.
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
        """Computes n efforts [N m or N] for a tick, without the compensation of gravity and Coriolis forces.

        Args:
            mass: Mass matrix, shape (n, n).
            error: n position errors, desired minus measured [rad or m].
            velocity: n measured velocities [rad/s or m/s].
            wanted_velocity: n desired velocities [rad/s or m/s].
            push: n efforts [N m or N] to add, or one effort [N m or N] to add at all joints.
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
    """Returns the accelerations [rad/s^2 or m/s^2] of n joints with springs and dampers, by an implicit Euler step.

    Args:
        mass: Mass matrix, shape (n, n).
        stiffness: n stiffnesses [N m/rad or N/m].
        damping: n dampings [N m s/rad or N s/m].
        forces: n efforts [N m or N] that would act if the joints were at rest: the springs' efforts plus all others.
        velocity: n velocities [rad/s or m/s] before the tick.
        dt_s: Length of the tick [s].
    """
    by_velocity = damping + stiffness * dt_s
    stiff = mass.copy()
    stiff.reshape(-1)[:: len(mass) + 1] += by_velocity * dt_s
    return solve(stiff, forces - by_velocity * velocity)


def implicit_wrench(
    mobility: Array, stiffness: Array, damping: Array, wrench: Array, acceleration: Array, dt_s: float
) -> Array:
    """Returns the wrench of springs and dampers at a point of an arm, by an implicit Euler step, shape (6,).

    Args:
        mobility: Mobility matrix of the point, J M^-1 J^T, shape (6, 6). It maps wrenches to accelerations.
        stiffness: 6 stiffnesses [N/m, N m/rad], along and about the axes of the springs.
        damping: 6 dampings [N s/m, N m s/rad], along and about the same axes.
        wrench: Force [N] and moment [N m] that would act if the point were at rest, shape (6,): the springs' wrench
            plus additional pushes.
        acceleration: Velocity [m/s, rad/s] that the point would have after the tick without any spring, damper or
            push, divided by `dt_s`, shape (6,).
        dt_s: Length of the tick [s].
    """
    by_acceleration = (damping + stiffness * dt_s) * dt_s
    given = wrench - by_acceleration * acceleration
    root = np.sqrt(by_acceleration)  # of (1 + by_acceleration mobility) x = given, for a symmetric matrix
    scaled_mobility = root[:, None] * mobility
    return given - root * solve(_EYE + scaled_mobility * root, scaled_mobility @ given)


def force_for(mobility: Array, acceleration: Array) -> Array:
    """Returns the wrench [N, N m], shape (6,), that accelerates a point of an arm by `acceleration`.

    Args:
        mobility: Mobility matrix of the point, shape (6, 6), which may be singular.
        acceleration: Acceleration of the point [m/s^2, rad/s^2], shape (6,).
    """
    return solve(mobility + ROUNDING, acceleration)


def turn_between(start: Sequence[float], end: Sequence[float]) -> Vector:
    """Returns the rotation vector [rad] from one orientation to another; both are quaternions (x, y, z, w).

    The vector is expressed in the frame in which both orientations are given.
    """
    x, y, z, w = start
    a, b, c, d = end
    turn = a * w - d * x - b * z + c * y, b * w - d * y - c * x + a * z, c * w - d * z - a * y + b * x
    cosine, sine = d * w + a * x + b * y + c * z, math.hypot(*turn)
    scale = 2.0 * math.atan2(sine, abs(cosine)) / sine if sine > 1e-12 else 2.0
    return scaled(math.copysign(scale, cosine), turn)
