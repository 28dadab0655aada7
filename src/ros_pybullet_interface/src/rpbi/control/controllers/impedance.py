"""Springs and dampers that stay stable at a tick's length, however stiff.

An explicit spring of stiffness k on a mass m oscillates, and then diverges, once k dt^2 / m is large. Here the spring
is evaluated where the joint will be after the tick, which the mass matrix tells (Tan, Liu and Turk, "Stable
Proportional-Derivative Controllers", 2011).
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
from rpbi.urdf.joints import Joint

Array = npt.NDArray[np.float64]

DampingRatio = Annotated[float, Field(ge=0.0, le=2.0)]
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


def joint_impedance(
    mass: Array,
    stiffness: Array,
    damping_ratio: Array,
    error: Array,
    velocity: Array,
    wanted_velocity: Array,
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
        dt_s: Length of a tick [s].
    """
    damping = 2.0 * damping_ratio * np.sqrt(stiffness * mass.diagonal())
    ahead = stiffness * (error - velocity * dt_s) + damping * (wanted_velocity - velocity)
    accelerations = np.linalg.solve(mass + np.diag(damping * dt_s + stiffness * dt_s**2), ahead)
    efforts: Array = mass @ accelerations
    return efforts


def cartesian_impedance(
    mobility: Array, stiffness: Array, damping: Array, error: Array, velocity: Array, push: Array, dt_s: float
) -> Array:
    """Returns force and moment of a spring and damper at a point of an arm.

    Args:
        mobility: Acceleration of the point by force, J M^-1 J^T, shape (6, 6).
        stiffness: Shape (6, 6) [N/m, N m/rad].
        damping: Shape (6, 6) [N s/m, N m s/rad].
        error: From where the point is to where it is to be: way [m] and turn [rad], shape (6,).
        velocity: Of the point [m/s] and of the link's rotation [rad/s], shape (6,).
        push: A force [N] and moment [N m] beside the spring, shape (6,).
        dt_s: Length of a tick [s].
    """
    ahead = stiffness @ (error - velocity * dt_s) - damping @ velocity + push
    wrench: Array = np.linalg.solve(np.eye(6) + (damping * dt_s + stiffness * dt_s**2) @ mobility, ahead)
    return wrench


def damping_of(mobility: Array, turn: Array, stiffness: Array, ratio: float) -> Array:
    """Returns the diagonal damping that has a ratio to the critical one along each axis.

    Args:
        mobility: Acceleration by force, shape (6, 6).
        turn: The axes along which the stiffness is diagonal, as columns, shape (3, 3).
        stiffness: 6 stiffnesses along these axes [N/m, N m/rad].
        ratio: The damping ratio.

    Returns:
        6 dampings [N s/m, N m s/rad].
    """
    linear, angular = (np.einsum("ji,jk,ki->i", turn, part, turn) for part in (mobility[:3, :3], mobility[3:, 3:]))
    masses = 1.0 / np.maximum(np.concatenate((linear, angular)), 1.0 / LARGEST_MASS_KG)
    dampings: Array = 2.0 * ratio * np.sqrt(stiffness * masses)
    return dampings


def turn_between(start: Sequence[float], end: Sequence[float]) -> Array:
    """Returns the rotation vector [rad] from one quaternion (x, y, z, w) to another, in the axes that both are in."""
    x, y, z, w = start
    a, b, c, d = end
    turn = np.array([a * w - d * x - b * z + c * y, b * w - d * y - c * x + a * z, c * w - d * z - a * y + b * x])
    cosine = d * w + a * x + b * y + c * z
    if cosine < 0.0:
        turn, cosine = -turn, -cosine
    sine = float(np.linalg.norm(turn))
    return turn * (2.0 * math.atan2(sine, cosine) / sine) if sine > 1e-12 else 2.0 * turn
