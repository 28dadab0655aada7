"""A robot in the scene of a plan: its model, limits and named postures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from custom_ros_tools.errors import UnknownNameError
from robot_model.geometry import Pose
from robot_model.limits import MAX_MAGNITUDE
from robot_model.model import RobotModel
from robot_model.urdf.document import disabled_collisions
from safe_robot.limits import LimitsConfig, MotionLimits

if TYPE_CHECKING:
    from safe_robot.guard import Guard

DEFAULT_LIMITS = LimitsConfig(acceleration=5.0, jerk=50.0)
"""Limits of robots whose limits are not given: the URDF's positions and velocities, 5 rad/s^2 and 50 rad/s^3."""
UNLIMITED_VELOCITY = 1.0
"""Largest speed of joints without a speed limit [rad/s or m/s]."""


class SceneRobot:
    """A robot of a scene.

    Args:
        name: Name of the robot.
        model: Joints and links of the robot.
        base: Pose of the root link in the world.
        positions: n joint positions [rad or m].
        limits: Limits of the joints; accelerations and jerks have to be finite.

    Attributes:
        postures: Named joint positions, shape (n,) each. `start` is the posture in which the robot came into the scene.
        limits: Limits of the n joints, all finite but those of positions.
        guard: The guard that checks plans, and the limits for which it was made; None before the first plan.
        never_checked: Pairs of links whose collisions are not checked, in addition to neighbours.
    """

    def __init__(
        self,
        name: str,
        model: RobotModel,
        base: Pose = Pose(),
        positions: Sequence[float] | None = None,
        limits: LimitsConfig = DEFAULT_LIMITS,
    ) -> None:
        self.name, self.model, self.base = name, model, base
        low, high = np.array(model.limits.lower), np.array(model.limits.upper)
        start = np.clip(np.zeros(len(low)) if positions is None else np.asarray(positions, float), low, high)
        self.positions = start
        self.postures: dict[str, np.ndarray] = {"start": start.copy()}
        self.never_checked: set[frozenset[str]] = set()
        self.guard: tuple[Any, Guard] | None = None
        self.set_limits(limits)

    def set_limits(self, limits: LimitsConfig) -> None:
        """Sets the limits of the joints, which may only narrow those of the URDF.

        Raises:
            ConfigError: If a limit is wider than in the URDF, or a joint is unknown.
        """
        model = self.model
        self.limits = with_finite_speeds(MotionLimits.of(model, limits, model.urdf_path))

    def read_srdf(self, path: str) -> None:
        """Reads the pairs of links whose collisions an SRDF file disables.

        Raises:
            ConfigError: If the file cannot be read.
        """
        self.never_checked |= disabled_collisions(path)

    def vector(self, given: Mapping[str, float] | Sequence[float] | None, what: str = "start") -> np.ndarray:
        """Returns n joint positions [rad or m] from a mapping by joint names, a sequence, or None for the present ones.

        Raises:
            UnknownNameError: If a joint is unknown.
            ValueError: If a position is not finite, or the number of positions is wrong.
        """
        names, q = self.model.joint_names, self.positions.copy()
        if isinstance(given, Mapping):
            for joint, position in given.items():
                if joint not in names:
                    raise UnknownNameError("joint", joint, names)
                q[names.index(joint)] = position
        elif given is not None:
            if len(given) != len(names):
                raise ValueError(f"{what}: expected {len(names)} joint positions of '{self.name}', got {len(given)}")
            q = np.array([float(position) for position in given])
        if not (np.isfinite(q).all() and (np.abs(q) <= MAX_MAGNITUDE).all()):
            raise ValueError(f"{what}: expected finite joint positions, got {q.tolist()}")
        return q


def with_finite_speeds(limits: MotionLimits) -> MotionLimits:
    """Replaces infinite limits of speed, acceleration and jerk by the defaults, so that motions can be timed."""
    config = DEFAULT_LIMITS
    assert isinstance(config.acceleration, float) and isinstance(config.jerk, float)
    return limits._replace(
        velocity=np.where(np.isfinite(limits.velocity), limits.velocity, UNLIMITED_VELOCITY),
        acceleration=np.where(np.isfinite(limits.acceleration), limits.acceleration, config.acceleration),
        jerk=np.where(np.isfinite(limits.jerk), limits.jerk, config.jerk),
    )
