"""An arm with an off-centre payload, and what its joints transmit by Newton and Euler, without PyBullet's help."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
DAMPING = 0.3
"""Of all joints that move [N m s/rad or N s/m]."""
GRAVITY = np.array([0.0, 0.0, -9.81])


class Link(NamedTuple):
    """A link and the joint that it hangs on; `parent` is the index of another link, -1 for the base."""

    name: str
    parent: int
    joint_type: str
    axis: tuple[float, float, float]
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    mass: float
    centre: tuple[float, float, float]
    inertia_rpy: tuple[float, float, float]
    inertia: tuple[float, float, float]


ARM = (
    Link(
        "upper",
        -1,
        "revolute",
        (0, 0.6, 0.8),
        (0, 0, 0.5),
        (0.1, 0.2, 0.3),
        2.0,
        (0.1, 0.05, 0.2),
        (0.3, -0.5, 0.7),
        (0.02, 0.03, 0.04),
    ),
    Link(
        "slider",
        0,
        "prismatic",
        (0.36, 0.48, 0.8),
        (0.2, 0.1, 0.3),
        (-0.5, 0.2, 0.3),
        1.5,
        (-0.1, 0.15, 0.1),
        (-0.3, 0.2, 1.7),
        (0.01, 0.03, 0.035),
    ),
    Link(
        "wrist",
        1,
        "revolute",
        (1, 0, 0),
        (0.0, 0.1, 0.2),
        (0.4, -0.2, 0.9),
        0.8,
        (0.02, 0.03, 0.1),
        (0.0, 0.4, 0.1),
        (0.002, 0.003, 0.002),
    ),
    Link(
        "side",
        1,
        "fixed",
        (0, 0, 1),
        (-0.1, 0.0, 0.1),
        (0.0, 1.0, 0.0),
        0.4,
        (0.0, -0.05, 0.0),
        (0.0, 0.0, 0.0),
        (0.001, 0.001, 0.001),
    ),
    Link(
        "flange",
        2,
        "fixed",
        (0, 0, 1),
        (0.05, 0.0, 0.1),
        (0.3, 0.5, -0.8),
        0.2,
        (0.0, 0.01, 0.02),
        (0.0, 0.0, 0.0),
        (0.0003, 0.0003, 0.0004),
    ),
    Link(
        "payload",
        4,
        "fixed",
        (0, 0, 1),
        (0.0, 0.1, 0.05),
        (1.0, 0.0, 0.5),
        3.0,
        (0.12, -0.07, 0.09),
        (0.5, 0.4, -0.3),
        (0.01, 0.02, 0.025),
    ),
)
MOVING = [index for index, link in enumerate(ARM) if link.joint_type != "fixed"]


def urdf() -> str:
    """Returns the arm as a robot description; the joint of link X is called X_joint."""
    parts = ['<robot name="arm"><link name="base"/>']
    for link in ARM:
        ixx, iyy, izz = link.inertia
        parts.append(
            f'<link name="{link.name}"><inertial><origin xyz="{_text(link.centre)}" rpy="{_text(link.inertia_rpy)}"/>'
            f'<mass value="{link.mass}"/><inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/>'
            f'</inertial></link><joint name="{link.name}_joint" type="{link.joint_type}">'
            f'<parent link="{ARM[link.parent].name if link.parent >= 0 else "base"}"/><child link="{link.name}"/>'
            f'<origin xyz="{_text(link.xyz)}" rpy="{_text(link.rpy)}"/><axis xyz="{_text(link.axis)}"/>'
            f'<limit lower="-3" upper="3" effort="1000" velocity="20"/><dynamics damping="{DAMPING}"/></joint>'
        )
    return "".join(parts) + "</robot>"


def wrenches(q: dict[int, float], dq: dict[int, float], ddq: dict[int, float]) -> list[tuple[Array, Array]]:
    """Returns what every joint's parent side does to its child side.

    Args:
        q: Position of each moving joint [rad or m] by index of its link.
        dq: Their velocities.
        ddq: Their accelerations.

    Returns:
        Of each link force [N] and moment about the origin of its frame [N m], in its own axes.
    """
    rotations: list[Array] = []
    origins: list[Array] = []
    turnings: list[Array] = []  # angular velocity, then acceleration of turning and of the origin
    alphas: list[Array] = []
    accelerations: list[Array] = []
    own: list[tuple[Array, Array]] = []
    for index, link in enumerate(ARM):
        fixed = link.parent < 0
        parent_rotation = np.eye(3) if fixed else rotations[link.parent]
        zero = np.zeros(3)
        omega, alpha = (zero, zero) if fixed else (turnings[link.parent], alphas[link.parent])
        start = zero if fixed else origins[link.parent]
        acceleration = zero if fixed else accelerations[link.parent]
        frame = parent_rotation @ _rotation(link.rpy)
        axis = frame @ np.array(link.axis, float)
        lever = parent_rotation @ np.array(link.xyz)
        position, velocity, change = (values.get(index, 0.0) for values in (q, dq, ddq))
        if link.joint_type == "revolute":
            rotation = frame @ _about(np.array(link.axis, float), position)
            acceleration = acceleration + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
            alpha = alpha + axis * change + np.cross(omega, axis * velocity)
            omega = omega + axis * velocity
        else:
            rotation = frame
            lever = lever + axis * position
            acceleration = (
                acceleration
                + np.cross(alpha, lever)
                + np.cross(omega, np.cross(omega, lever))
                + 2 * np.cross(omega, axis * velocity)
                + axis * change
            )
        rotations.append(rotation)
        origins.append(start + lever)
        turnings.append(omega)
        alphas.append(alpha)
        accelerations.append(acceleration)
        centre = rotation @ np.array(link.centre)
        principal = rotation @ _rotation(link.inertia_rpy)
        inertia = principal @ np.diag(link.inertia) @ principal.T
        of_centre = acceleration + np.cross(alpha, centre) + np.cross(omega, np.cross(omega, centre))
        force = link.mass * (of_centre - GRAVITY)
        moment = inertia @ alpha + np.cross(omega, inertia @ omega) + np.cross(centre, force)
        own.append((force, moment))
    for index in reversed(range(len(ARM))):
        parent = ARM[index].parent
        if parent >= 0:
            force, moment = own[index]
            lever = origins[index] - origins[parent]
            own[parent] = own[parent][0] + force, own[parent][1] + moment + np.cross(lever, force)
    return [(rotation.T @ force, rotation.T @ moment) for rotation, (force, moment) in zip(rotations, own, strict=True)]


def _text(values: tuple[float, float, float]) -> str:
    return " ".join(map(str, values))


def _about(axis: Array, angle: float) -> Array:
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def _rotation(rpy: tuple[float, float, float]) -> Array:
    roll, pitch, yaw = rpy
    x, y, z = np.eye(3)
    return _about(z, yaw) @ _about(y, pitch) @ _about(x, roll)
