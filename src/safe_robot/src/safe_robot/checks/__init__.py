"""Table of the safety checks. To add a check, write its class in a new file, and add a line to the table."""

from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.plugin_table import PluginTable
from robot_model.model import RobotModel
from safe_robot.check import Check
from safe_robot.limits import MotionLimits

CHECKS: PluginTable[Check] = PluginTable(
    "check",
    "safe_robot.check:Check",
    {
        "joint_position": "safe_robot.checks.joint_position:JointPosition",
        "joint_velocity": "safe_robot.checks.joint_velocity:JointVelocity",
        "joint_acceleration": "safe_robot.checks.joint_acceleration:JointAcceleration",
        "joint_jerk": "safe_robot.checks.joint_jerk:JointJerk",
        "link_box": "safe_robot.checks.link_box:LinkBox",
        "link_velocity": "safe_robot.checks.link_velocity:LinkVelocity",
        "self_collision": "safe_robot.checks.self_collision:SelfCollision",
        "environment": "safe_robot.checks.environment:Environment",
        "staleness": "safe_robot.checks.staleness:Staleness",
        "tracking": "safe_robot.checks.tracking:Tracking",
        "force": "safe_robot.checks.force:Force",
    },
)
"""All checks, in the order in which a guard runs them."""


def make_checks(
    options: Mapping[str, Mapping[str, Any]], robot: RobotModel, limits: MotionLimits, file: str
) -> list[Check]:
    """Creates all default checks and all checks named in `options`, except those with `active: false`.

    Args:
        options: Options of each check, indexed by check name.
        robot: The guarded robot.
        limits: Limits of the robot's joints.
        file: Source of the options, for messages.

    Raises:
        ConfigError: If a check is unknown, or a check's options are wrong.
    """
    checks = []
    for name in dict.fromkeys((*CHECKS, *options)):
        try:
            each: Any = CHECKS.find(name)
        except (InterfaceError, ValueError) as error:
            raise ConfigError([Problem(file, f"checks.{name}", str(error))]) from None
        if name in options or each.is_default:
            try:
                config = each.Config.parse(options.get(name, {}), file)
            except ConfigError as error:
                problems = [
                    Problem(one.file, f"checks.{name}.{one.key}".rstrip("."), one.message) for one in error.problems
                ]
                raise ConfigError(problems) from None
            if config.active:
                checks.append(each(config, robot, limits, file))
    return checks
