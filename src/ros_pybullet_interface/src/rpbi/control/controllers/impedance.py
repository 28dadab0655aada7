"""Springs and dampers that stay stable at a tick's length, however stiff.

An explicit spring of stiffness k on a mass m oscillates, and then diverges, once k dt^2 / m is large. Here the spring
is evaluated where the joint will be after the tick, which the mass matrix tells (Tan, Liu and Turk, "Stable
Proportional-Derivative Controllers", 2011) and what else acts on the joint, which is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field
from scipy.linalg import lapack

from custom_ros_tools.errors import hint
from custom_ros_tools.schema import ConfigModel, Positive, Unit
from rpbi.urdf.joints import Joint

Array = npt.NDArray[np.float64]

DampingRatio = Annotated[float, Field(ge=0.0, le=2.0)]
SMOOTHED_S = 0.01
"""Time constant of the estimate of external efforts [s]."""
_EYE = np.eye(6)
ROUNDING = 1e-6 * np.eye(6)
"""Keeps the mobility of a singular arm invertible."""
LARGEST_MASS_KG = 100.0
"""Of a direction in which the arm can hardly move, for damping."""


class JointSprings(ConfigModel):
    """Springs and dampers at joints."""

    stiffness: Annotated[Positive, Unit("N m/rad or N/m")] | dict[str, Positive] = Field(
        500.0, description="Of all joints, or by joint."
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


class ExternalEfforts:
    """Estimates what acts on n joints beside the efforts that a controller knows of, from how they accelerate.

    Args:
        count: How many joints there are.
        dt_s: Length of a tick [s].
    """

    def __init__(self, count: int, dt_s: float) -> None:
        self.estimate = np.zeros(count)
        """n efforts [N m or N], smoothed by a first-order filter of 10 ms."""
        self._dt_s = dt_s
        self._share = 1.0 - math.exp(-dt_s / SMOOTHED_S)
        self._last: tuple[Array, Array, Array] | None = None

    def update(self, velocity: Array) -> None:
        """Takes the velocities [rad/s or m/s] after the tick of the last `note`."""
        if self._last is not None:
            mass, net, before = self._last
            self.estimate += self._share * (mass @ (velocity - before) / self._dt_s - net - self.estimate)

    def note(self, mass: Array, net: Array, velocity: Array) -> None:
        """Notes the mass matrix, the efforts of a tick beyond the bias, and the velocities before it."""
        self._last = mass, net, velocity


def joint_impedance(
    mass: Array,
    stiffness: Array,
    damping_ratio: Array | float,
    error: Array,
    velocity: Array,
    wanted_velocity: Array | float,
    external: Array,
    dt_s: float,
) -> Array:
    """Returns the efforts of springs and dampers at n joints.

    Args:
        mass: Mass matrix, shape (n, n).
        stiffness: n stiffnesses [N m/rad or N/m].
        damping_ratio: n damping ratios of each joint with its own inertia (Lehr's); 1 is critical.
        error: How far each joint is from where it is to be [rad or m], positive if it is to move forward.
        velocity: n measured velocities [rad/s or m/s].
        wanted_velocity: n velocities that joints are to have.
        external: n efforts [N m or N] that something else applies.
        dt_s: Length of a tick [s].
    """
    damping = 2.0 * damping_ratio * np.sqrt(stiffness * mass.diagonal())
    ahead = stiffness * (error - velocity * dt_s) + damping * (wanted_velocity - velocity) + external
    stiff = mass.copy()
    stiff.flat[:: len(mass) + 1] += (damping + stiffness * dt_s) * dt_s
    efforts: Array = mass @ lapack.dposv(stiff, ahead)[1] - external
    return efforts


class JointImpedance:
    """Springs and dampers at n joints from tick to tick.

    Args:
        springs: How stiff and how damped they are.
        joints: The n joints.
        dt_s: Length of a tick [s].

    Raises:
        ValueError: If the springs name a joint that is none of these.
    """

    def __init__(self, springs: JointSprings, joints: Sequence[Joint], dt_s: float) -> None:
        self._stiffness = springs.by_joint("stiffness", joints)
        self._damping_ratio = springs.by_joint("damping_ratio", joints)
        self._dt_s = dt_s
        self.restart()

    def restart(self) -> None:
        """Forgets what acted on the joints."""
        self._external = ExternalEfforts(len(self._stiffness), self._dt_s)

    def efforts(
        self, mass: Array, error: Array, velocity: Array, wanted_velocity: Array, push: Array | float = 0.0
    ) -> Array:
        """Returns n efforts [N m or N] for a tick, beyond those that balance gravity and motion.

        Args:
            mass: Mass matrix, shape (n, n).
            error: How far each joint is from where it is to be [rad or m].
            velocity: n measured velocities [rad/s or m/s].
            wanted_velocity: n velocities that joints are to have.
            push: n efforts [N m or N] to add.
        """
        self._external.update(velocity)
        external = self._external.estimate
        springs = joint_impedance(
            mass, self._stiffness, self._damping_ratio, error, velocity, wanted_velocity, external, self._dt_s
        )
        self._external.note(mass, springs + push, velocity)
        return springs + push


def cartesian_impedance(
    mobility: Array,
    stiffness: Array,
    damping: Array,
    error: Array,
    velocity: Array,
    push: Array,
    external: Array,
    dt_s: float,
) -> Array:
    """Returns force and moment of a spring and damper at a point of an arm, along the axes of the springs.

    Args:
        mobility: Acceleration of the point by force, J M^-1 J^T, shape (6, 6).
        stiffness: 6 stiffnesses [N/m, N m/rad].
        damping: 6 dampings [N s/m, N m s/rad].
        error: From where the point is to where it is to be: way [m] and turn [rad], shape (6,).
        velocity: Of the point [m/s] and of the link's rotation [rad/s], shape (6,).
        push: A force [N] and moment [N m] beside the spring, shape (6,).
        external: How what else acts on the arm accelerates the point [m/s^2, rad/s^2], shape (6,).
        dt_s: Length of a tick [s].
    """
    by_acceleration = (damping + stiffness * dt_s) * dt_s
    ahead = stiffness * (error - velocity * dt_s) - damping * velocity + push - by_acceleration * external
    wrench: Array = lapack.dgesv(_EYE + by_acceleration[:, None] * mobility, ahead)[2]
    return wrench


def critical_damping(mobility: Array, stiffness: Array) -> Array:
    """Returns the 6 dampings [N s/m, N m s/rad] that are critical along each axis of springs.

    Args:
        mobility: Acceleration by force, shape (6, 6).
        stiffness: 6 stiffnesses [N/m, N m/rad].
    """
    dampings: Array = 2.0 * np.sqrt(stiffness / np.maximum(mobility.diagonal(), 1.0 / LARGEST_MASS_KG))
    return dampings


def inverse(matrix: Array) -> Array:
    """Returns the inverse of a symmetric positive definite matrix, such as a mass matrix.

    It takes no solution of several right sides at once: LAPACK makes them in threads of its own, which on a busy
    machine wait for each other for many times as long as the sums take.
    """
    root = lapack.dtrtri(lapack.dpotrf(matrix, lower=1)[0], lower=1)[0]
    inverted: Array = root.T @ root
    return inverted


def force_for(mobility: Array, acceleration: Array) -> Array:
    """Returns force and moment that give a point an acceleration [m/s^2, rad/s^2], shapes (6,).

    Args:
        mobility: Acceleration by force, shape (6, 6); of a singular arm it is not invertible but for a small part.
    """
    wrench: Array = lapack.dposv(mobility + ROUNDING, acceleration)[1]
    return wrench


def turn_between(start: Sequence[float], end: Sequence[float]) -> Array:
    """Returns the rotation vector [rad] from one quaternion (x, y, z, w) to another, in the axes that both are in."""
    x, y, z, w = start
    a, b, c, d = end
    turn = a * w - d * x - b * z + c * y, b * w - d * y - c * x + a * z, c * w - d * z - a * y + b * x
    cosine, sine = d * w + a * x + b * y + c * z, math.hypot(*turn)
    scale = 2.0 * math.atan2(sine, abs(cosine)) / sine if sine > 1e-12 else 2.0
    return np.array(turn) * math.copysign(scale, cosine)
