"""Kinematics of the robot's hand that holds a cuff, and the controller that pulls the sleeve over a person's arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ik_ros.problem import IKProblem
from ik_ros.solvers.pybullet_solver import PybulletConfig, PybulletSolver
from robot_model.geometry import Pose

from .cuff_path import AHEAD_AT_START, ArmPosition, Array, CuffPath

RADIUS_M = 0.085
"""Radius of the cuff [m]."""
ROBOT, BASE_LINK, HAND_LINK = "franka_panda/panda.urdf", "panda_link0", "panda_grasptarget"
"""The robot's URDF file from PyBullet's data, its root link, and its link between the fingertips."""
ROBOT_BASE = Pose((0.4, -0.85, 0.7))
"""Base of the robot in the world, as in `panda.yaml`."""
MAX_TURN_RAD = 0.3
"""Largest rotation of a joint between two targets [rad]. Solutions with a larger rotation are not used."""
TARGET_HZ = 50
"""Rate of the targets [Hz]."""
SETTLING_S = 0.5
"""Time for which the robot holds the cuff at the end of its path [s]."""
MAX_LEAD_M = 0.02
"""Largest distance of the cuff's target from the cuff [m]. At a larger distance, the target waits."""
MAX_TURN_RATE = 1.5
"""Largest angular speed of the cuff [rad/s]."""


class HandTarget(NamedTuple):
    """Target pose of the point between the robot's fingertips, in the world.

    Attributes:
        position: x, y, z [m].
        quat_xyzw: Orientation. The axis z points at the person's arm; x points against the direction of pulling.
    """

    position: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]


def holding(cuff: Array, ahead: Array) -> HandTarget:
    """Returns the hand's pose for holding the right side of a cuff. The hand is horizontal.

    Args:
        cuff: Middle of the cuff, shape (3,) [m].
        ahead: Direction in which the cuff is pulled, a unit vector of shape (3,).
    """
    to_arm = np.cross((0.0, 0.0, 1.0), -ahead)
    to_arm /= np.linalg.norm(to_arm)
    back = -ahead
    quat = Rotation.from_matrix(np.stack((back, np.cross(to_arm, back), to_arm), axis=1)).as_quat()
    x, y, z = (cuff - RADIUS_M * to_arm).tolist()
    return HandTarget((x, y, z), tuple(quat.tolist()))


class HandSolver:
    """Forward and inverse kinematics of the robot that holds the cuff.

    Attributes:
        joint_names: Names of the arm's joints. The methods expect joint positions in this order.
    """

    def __init__(self) -> None:
        options = {"urdf_filename": ROBOT, "base_link": BASE_LINK, "tip_link": HAND_LINK}
        self._solver = PybulletSolver(PybulletConfig.parse(options, "the robot"))
        self.joint_names = self._solver.joint_names

    def cuff(self, positions: Sequence[float]) -> Array:
        """Returns the position of the middle of the cuff in the world, shape (3,) [m].

        Args:
            positions: Positions of the joints [rad].
        """
        in_hand = Pose((0.0, 0.0, RADIUS_M))
        return np.array((ROBOT_BASE @ self._solver.chain.pose(positions) @ in_hand).position)

    def solve(self, target: HandTarget, positions: Sequence[float]) -> dict[str, float] | None:
        """Returns joint positions [rad] indexed by joint name. None if a solution near `positions` was not found.

        Args:
            target: Target pose of the hand.
            positions: Present positions of the joints [rad].
        """
        in_base = ROBOT_BASE.inverse() @ Pose(target.position, target.quat_xyzw)
        solution = self._solver.solve(IKProblem(in_base, start=dict(zip(self.joint_names, positions))))
        turns = (abs(there - here) for there, here in zip(solution.positions, positions))
        is_near = solution.success and max(turns) <= MAX_TURN_RAD
        return dict(zip(self.joint_names, solution.positions)) if is_near else None


class Dressing:
    """Computes targets of the robot's hand that move the cuff along a person's arm. The arm may move meanwhile.

    The cuff slows down as a force on the arm approaches its limit, and moves back while a limit is exceeded. The target
    waits while the cuff lags behind the target, so that the hand does not jump afterwards.

    Args:
        speed: Speed of the cuff without contact [m/s].
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._left_m: float | None = None
        self._rested_s = 0.0
        self._ahead = np.array(AHEAD_AT_START)

    @property
    def has_begun(self) -> bool:
        """Whether `target` has been called."""
        return self._left_m is not None

    @property
    def is_done(self) -> bool:
        """Whether the target has been at the end of the cuff's path for `SETTLING_S`."""
        return self._rested_s >= SETTLING_S

    def target(self, arm: ArmPosition, cuff: Array, force_share: float, dt: float) -> HandTarget:
        """Advances the target along the cuff's path, and returns the corresponding target of the robot's hand.

        Args:
            arm: Positions of shoulder, elbow and wrist of the person's arm.
            cuff: Present position of the middle of the cuff, shape (3,) [m].
            force_share: Largest ratio of a force on the arm to the force's limit; see `ArmForce.share`.
            dt: Time since the last call [s].
        """
        path = CuffPath(arm)
        if self._left_m is None:
            self._left_m = path.length
        speed = self._speed * max(-1.0, 1.0 - force_share)
        if np.linalg.norm(path.place(path.length - self._left_m) - cuff) > MAX_LEAD_M:
            speed = min(speed, 0.0)
        self._left_m = min(max(self._left_m - speed * dt, 0.0), path.length)
        self._rested_s = 0.0 if self._left_m else self._rested_s + dt
        done = path.length - self._left_m
        self._ahead = _towards(self._ahead, path.ahead(done), MAX_TURN_RATE * dt)
        self._ahead /= np.linalg.norm(self._ahead)
        return holding(_towards(cuff, path.place(done), MAX_LEAD_M), self._ahead)


def _towards(start: Array, end: Array, largest: float) -> Array:
    """Moves from `start` towards `end` by at most the distance `largest`, and returns the point reached."""
    step = end - start
    return start + step * min(1.0, largest / max(float(np.linalg.norm(step)), 1e-12))
