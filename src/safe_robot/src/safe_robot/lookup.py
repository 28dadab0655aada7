"""Creates the checks of a guard from its configuration."""

from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem

from .check import Check
from .checks import CHECKS
from .limits import MotionLimits
from .robot import GuardedRobot


def make_checks(
    options: Mapping[str, Mapping[str, Any]], robot: GuardedRobot, limits: MotionLimits, file: str
) -> list[Check]:
    """Returns the checks of a guard: those on by default and those with options, without those that are switched off.

    Args:
        options: Options by name of the check.
        file: Source of the options, for messages.

    Raises:
        ConfigError: If a check is not known, or its options are wrong.
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
