"""The robot's hand that holds the cuff: its target, its pose and its joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ik_ros.problem import IKProblem
from ik_ros.solvers.pybullet_solver import PybulletConfig, PybulletSolver
from robot_model.geometry import Pose

from .way import Array

RADIUS_M = 0.085
"""Radius of the cuff."""
ROBOT, BASE_LINK, HAND_LINK = "franka_panda/panda.urdf", "panda_link0", "panda_grasptarget"
"""A file of PyBullet's data, its root link, and the link between the fingertips."""
ROBOT_BASE = Pose((0.4, -0.85, 0.7))
"""Base of the robot in the world, as in `panda.yaml`."""
MAX_TURN_RAD = 0.3
"""Largest rotation of a joint to the next target; beyond it, the joints keep their positions."""


class HandTarget(NamedTuple):
    """Pose of the point between the fingertips of the robot in the world.

    Attributes:
        position: x, y, z [m].
        quat_xyzw: Its orientation: z points at the person's arm, and x along the trailing sleeve.
    """

    position: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]


def holding(cuff: Array, ahead: Array) -> HandTarget:
    """Returns the pose of a hand that holds the cuff at its right side, level.

    Args:
        cuff: Middle of the cuff (3) [m].
        ahead: Direction in which it is drawn, as unit vector (3).
    """
    to_arm = np.cross((0.0, 0.0, 1.0), -ahead)
    to_arm /= np.linalg.norm(to_arm)
    back = -ahead
    quat = Rotation.from_matrix(np.stack((back, np.cross(to_arm, back), to_arm), axis=1)).as_quat()
    x, y, z = (cuff - RADIUS_M * to_arm).tolist()
    return HandTarget((x, y, z), tuple(quat.tolist()))


class HandSolver:
    """Kinematics of the robot that holds the cuff.

    Attributes:
        joint_names: The joints of its arm, in the order of all positions here.
    """

    def __init__(self) -> None:
        options = {"urdf_filename": ROBOT, "base_link": BASE_LINK, "tip_link": HAND_LINK}
        self._solver = PybulletSolver(PybulletConfig.parse(options, "the robot"))
        self.joint_names = self._solver.joint_names

    def cuff(self, positions: Sequence[float]) -> Array:
        """Returns the position of the middle of the cuff in the world (3) [m].

        Args:
            positions: Positions of the joints [rad].
        """
        in_hand = Pose((0.0, 0.0, RADIUS_M))
        return np.array((ROBOT_BASE @ self._solver.chain.pose(positions) @ in_hand).position)

    def solve(self, target: HandTarget, positions: Sequence[float]) -> dict[str, float] | None:
        """Returns positions of the joints [rad], or None if there are none nearby.

        Args:
            target: Target pose of the hand.
            positions: Present positions of the joints [rad].
        """
        in_base = ROBOT_BASE.inverse() @ Pose(target.position, target.quat_xyzw)
        solution = self._solver.solve(IKProblem(in_base, start=dict(zip(self.joint_names, positions))))
        turns = (abs(there - here) for there, here in zip(solution.positions, positions))
        is_near = solution.success and max(turns) <= MAX_TURN_RAD
        return dict(zip(self.joint_names, solution.positions)) if is_near else None
