"""The robot's hand that holds the cuff: where it is to be, where it is, and by which joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from robot_model.geometry import Pose
from rpbi.kinematics import Kinematics
from rpbi.kinematics.problem import PybulletProblem

from .way import Array

RADIUS_M = 0.085
"""File of the sleeve."""
ROBOT, HAND_LINK = "franka_panda/panda.urdf", "panda_grasptarget"
"""File of PyBullet's data."""
ROBOT_BASE = Pose((0.4, -0.85, 0.7))
"""Base of the robot, as in `panda.yaml`."""
MAX_TURN_RAD = 0.3
"""Joints that would have to turn farther for the next target stay where they are."""


class HandTarget(NamedTuple):
    """Pose of the point between the fingertips of the robot in the world.

    Attributes:
        position: x, y, z [m].
        quat_xyzw: Its orientation: z points at the person's arm, and x along the trailing sleeve.
    """

    position: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]


def holding(cuff: Array, ahead: Array) -> HandTarget:
    """Returns where the hand is that holds the cuff at its right side, level.

    Args:
        cuff: Middle of the cuff (3) [m].
        ahead: Where it is drawn to, as unit vector (3).
    """
    to_arm = np.cross((0.0, 0.0, 1.0), -ahead)
    to_arm /= np.linalg.norm(to_arm)
    back = -ahead
    quat = Rotation.from_matrix(np.stack((back, np.cross(to_arm, back), to_arm), axis=1)).as_quat()
    x, y, z = (cuff - RADIUS_M * to_arm).tolist()
    return HandTarget((x, y, z), tuple(quat.tolist()))


class HandSolver:
    """Kinematics of the robot that holds the cuff.

    Args:
        kinematics: The robot's.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics

    def cuff(self, positions: Sequence[float]) -> Array:
        """Returns where the middle of the cuff is in the world (3) [m].

        Args:
            positions: Where all joints that move are [rad or m].
        """
        in_hand = Pose((0.0, 0.0, RADIUS_M))
        return np.array((ROBOT_BASE @ self._kinematics.forward(positions, HAND_LINK) @ in_hand).position)

    def solve(self, target: HandTarget, positions: Sequence[float]) -> dict[str, float] | None:
        """Returns positions of the arm's joints [rad], or None if there are none nearby.

        Args:
            target: Where the hand is to be.
            positions: Where all joints that move are now [rad or m].
        """
        in_base = ROBOT_BASE.inverse() @ Pose(target.position, target.quat_xyzw)
        problem = PybulletProblem(HAND_LINK, in_base.position, in_base.quat_xyzw, currentPosition=positions)
        solution = self._kinematics.solve(problem)
        found = dict(zip(solution.chain, solution.chain_positions))
        now = dict(zip(self._kinematics.joint_names, positions))
        near = all(abs(found[name] - now[name]) <= MAX_TURN_RAD for name in found)
        return found if solution.success and near else None
