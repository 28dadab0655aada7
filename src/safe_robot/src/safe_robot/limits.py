"""Limits of the guarded joints: the limits in the robot's description, narrowed by the configuration."""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem, hint
from custom_ros_tools.schema import ConfigModel, Positive
from robot_model.model import RobotModel

Factor = Annotated[float, Field(gt=0, le=1)]
PerJoint = Positive | dict[str, Positive]
"""One number for all joints, or a number for each joint name."""


class LimitsConfig(ConfigModel):
    """Joint limits, which narrow the limits in the robot's URDF."""

    lower: dict[str, float] = Field(
        {},
        description="Lower position limits [rad or m], keyed by joint name. They may narrow the range in the URDF, "
        "but not widen it.",
    )
    upper: dict[str, float] = Field(
        {},
        description="Upper position limits [rad or m], keyed by joint name. They may narrow the range in the URDF, "
        "but not widen it.",
    )
    position_factor: Factor = Field(
        1.0, description="Fraction of each joint's range, about the middle of the range, that is used."
    )
    velocity: PerJoint | None = Field(
        None,
        description="Speed limit [rad/s or m/s]: one for all joints, or a mapping from joint names to limits. By "
        "default, the limits in the URDF.",
    )
    velocity_factor: Factor = Field(0.95, description="Fraction of the speed limits that is used.")
    acceleration: PerJoint | None = Field(
        None,
        description="Acceleration limit [rad/s^2 or m/s^2]: one for all joints, or a mapping from joint names to "
        "limits. By default, accelerations are not limited.",
    )
    jerk: PerJoint | None = Field(
        None,
        description="Jerk limit [rad/s^3 or m/s^3]: one for all joints, or a mapping from joint names to limits. By "
        "default, jerks are not limited.",
    )


class MotionLimits(NamedTuple):
    """Limits of n joints; infinite where a joint has no limit.

    Attributes:
        lower: Lower position limits, shape (n,) [rad or m].
        upper: Upper position limits, shape (n,) [rad or m].
        velocity: Largest speeds, shape (n,) [rad/s or m/s].
        acceleration: Largest accelerations, shape (n,) [rad/s^2 or m/s^2].
        jerk: Largest jerks, shape (n,) [rad/s^3 or m/s^3].
    """

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    @classmethod
    def of(cls, robot: RobotModel, config: LimitsConfig, file: str) -> "MotionLimits":
        """Returns the limits of a robot's joints, narrowed by a configuration.

        Raises:
            ConfigError: If a lower limit is not below the upper limit, a limit given for one joint is wider than in the
                robot's description, or a joint is unknown. The message names the file and the key.
        """
        problems: list[Problem] = []
        lower = _narrowed(robot, "lower", [joint.lower for joint in robot.joints], config.lower, problems, file)
        upper = _narrowed(robot, "upper", [joint.upper for joint in robot.joints], config.upper, problems, file)
        for name, least, most in zip(robot.joint_names, lower, upper):
            if least >= most:
                message = f"expected a lower limit below the upper one, got {least:g} and {most:g}"
                problems.append(Problem(file, f"limits.lower.{name}", message))
        fastest = [joint.max_velocity for joint in robot.joints]
        velocity = _largest(robot, "velocity", fastest, config.velocity, problems, file)
        unlimited = [math.inf] * len(robot.joints)
        acceleration = _largest(robot, "acceleration", unlimited, config.acceleration, problems, file)
        jerk = _largest(robot, "jerk", unlimited, config.jerk, problems, file)
        if problems:
            raise ConfigError(problems)
        low, high = np.array(lower), np.array(upper)
        span = np.where(np.isfinite(high - low), high - low, 0.0)
        cut = (1.0 - config.position_factor) / 2.0 * span
        return cls(
            low + cut, high - cut, config.velocity_factor * np.array(velocity), *map(np.array, (acceleration, jerk))
        )


def _narrowed(
    robot: RobotModel, key: str, own: Sequence[float], given: dict[str, float], problems: list[Problem], file: str
) -> list[float]:
    _check_names(robot, f"limits.{key}", given, problems, file)
    limits = list(own)
    for i, name in enumerate(robot.joint_names):
        if name not in given:
            continue
        is_inside = given[name] >= own[i] if key == "lower" else given[name] <= own[i]
        if not is_inside:
            side = "above" if key == "lower" else "below"
            message = f"expected a limit {side} that of {robot.urdf_path}, {own[i]:g}, got {given[name]:g}"
            problems.append(Problem(file, f"limits.{key}.{name}", message))
        limits[i] = given[name]
    return limits


def _largest(
    robot: RobotModel,
    key: str,
    own: Sequence[float],
    given: float | dict[str, float] | None,
    problems: list[Problem],
    file: str,
) -> list[float]:
    if given is None:
        return list(own)
    by_joint = given if isinstance(given, dict) else dict.fromkeys(robot.joint_names, given)
    _check_names(robot, f"limits.{key}", by_joint, problems, file)
    for name, most in zip(robot.joint_names, own):
        if by_joint.get(name, 0.0) > most and isinstance(given, dict):
            message = f"expected at most that of {robot.urdf_path}, {most:g}, got {by_joint[name]:g}"
            problems.append(Problem(file, f"limits.{key}.{name}", message))
    return [min(most, by_joint.get(name, math.inf)) for name, most in zip(robot.joint_names, own)]


def _check_names(robot: RobotModel, key: str, given: dict[str, float], problems: list[Problem], file: str) -> None:
    for name in given:
        if name not in robot.joint_names:
            problems.append(Problem(file, f"{key}.{name}", f"unknown joint{hint(name, robot.joint_names)}"))
