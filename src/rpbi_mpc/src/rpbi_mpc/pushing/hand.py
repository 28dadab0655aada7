"""Inverse kinematics of a hand that moves in a horizontal plane."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel, ListOf, Text, Unit
from robot_model.asset_files import find_file
from robot_model.linear_algebra import solve
from robot_model.model import RobotModel

TOLERANCE_M, TOLERANCE_RAD = 1e-4, 1e-3
"""Largest errors of position [m] and orientation [rad] at which inverse kinematics stop."""
MAX_ITERATIONS = 100
"""Number of Newton steps after which a position counts as out of reach."""
MAX_STEP_RAD = 0.1
"""Largest change of a joint in a Newton step [rad]. Larger changes can lead to a jump to a different posture."""
DAMPING = 1e-3
"""Damping of the least squares [m^2/rad^2]. With a larger value, the solver converges slowly. With a smaller value, the
solver oscillates near singular postures.
"""


class PlanarHandConfig(ConfigModel):
    """A point on an arm's hand that moves at a constant height and with a constant orientation.

    The hand does not turn, because the round tip of a turning hand would rub against the pushed face.

    Attributes:
        urdf: URDF file of the robot.
        link: Link whose origin is the point. The link's z axis points down.
        joints: Names of the joints that move the point.
        base: Position of the robot's root link in the world [m].
        height: Height of the point in the world [m].
        yaw: Angle about the vertical from the world's x axis to the link's x axis [rad].
        posture: Joint positions from which the first iteration starts [rad]. If empty, all positions are 0.
    """

    urdf: Text = Field(description="URDF file of the robot: a path or `{package}/path`.")
    link: Text = Field(description="Link whose origin is moved. The link's z axis points down.")
    joints: ListOf[Text] = Field(min_length=3, description="Names of the joints that move the link.")
    base: Annotated[tuple[float, float, float], Field(strict=False), Unit("m")] = Field(
        (0.0, 0.0, 0.0), description="Position of the robot's root link in the world."
    )
    height: Annotated[float, Unit("m")] = Field(0.02, description="Height of the link's origin in the world.")
    yaw: Annotated[float, Unit("rad")] = Field(
        0.0, description="Angle about the vertical from the world's x axis to the link's x axis."
    )
    posture: ListOf[float] = Field(
        (), description="Joint positions from which inverse kinematics start [rad]. If empty, all are 0."
    )


class PlanarHand:
    """Forward and inverse kinematics of the point that `PlanarHandConfig` describes.

    Inverse kinematics use damped least squares (C. Wampler, IEEE SMC 16, 1986). The same sequence of positions leads to
    the same joint positions on any computer.

    Args:
        config: Robot, joints, and height and orientation of the hand.

    Raises:
        ConfigError: If the URDF cannot be read.
        UnknownNameError: If the link or a joint is unknown.
        InterfaceError: If the posture does not have one number for each joint.
    """

    def __init__(self, config: PlanarHandConfig) -> None:
        self._robot = RobotModel(find_file(config.urdf, "hand"), config.joints)
        self._robot.check_link(config.link)
        self._config, self.joint_names = config, tuple(config.joints)
        posture = config.posture or [0.0] * len(config.joints)
        if len(posture) != len(config.joints):
            raise InterfaceError(f"hand.posture: expected {len(config.joints)} numbers, got {len(posture)}")
        self.posture = np.array(posture, dtype=float)

    def position(self, joints: np.ndarray) -> np.ndarray:
        """Returns the point's position in the world at given joint positions [rad], shape (3,) [m]."""
        position: np.ndarray = self._pose(joints)[:3, 3] + self._config.base
        return position

    def solve(self, start: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Returns joint positions [rad] that move the point to a position in the plane.

        Args:
            start: Joint positions from which the iteration starts [rad].
            place: Desired x, y of the point in the world [m]. The configuration specifies height and orientation.

        Raises:
            InterfaceError: If the position is out of reach.
        """
        goal = np.array([*place, self._config.height])
        q = np.clip(np.array(start, dtype=float), self._robot.limits.lower, self._robot.limits.upper)
        for _ in range(MAX_ITERATIONS):
            error = self._error(q, goal)
            if np.linalg.norm(error[:3]) < TOLERANCE_M and np.linalg.norm(error[3:]) < TOLERANCE_RAD:
                return q
            q = self._improved(q, error)
        place_text = ", ".join(f"{value:.3f}" for value in goal)
        raise InterfaceError(f"hand.{self._config.link}: expected a place within reach, got ({place_text}) m")

    def _error(self, q: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Returns the error of joint positions `q`, in the axes of the root link, shape (6,).

        The error consists of the vector from the point to the goal [m] and of the rotation vector to the desired
        orientation [rad].
        """
        pose, cos, sin = self._pose(q), np.cos(self._config.yaw), np.sin(self._config.yaw)
        wanted = np.array([[cos, sin, 0.0], [sin, -cos, 0.0], [0.0, 0.0, -1.0]])
        turn = Rotation.from_matrix(wanted @ pose[:3, :3].T).as_rotvec()
        return np.array([*(goal - self._config.base - pose[:3, 3]), *turn])

    def _improved(self, q: np.ndarray, error: np.ndarray) -> np.ndarray:
        """Returns the joint positions after one step of damped least squares, clipped to the joint limits."""
        jacobian = self._robot.frames.jacobian(q[None], self._config.link)[0]
        damped = jacobian @ jacobian.T + DAMPING * np.linalg.norm(error) * np.eye(6)
        step = jacobian.T @ solve(damped, error)
        step *= min(1.0, MAX_STEP_RAD / max(float(np.abs(step).max()), 1e-12))
        improved: np.ndarray = np.clip(q + step, self._robot.limits.lower, self._robot.limits.upper)
        return improved

    def _pose(self, joints: np.ndarray) -> np.ndarray:
        frame, in_frame = self._robot.frames.place(self._config.link)
        pose: np.ndarray = self._robot.frames.at(np.asarray(joints)[None])[0, frame] @ in_frame
        return pose
