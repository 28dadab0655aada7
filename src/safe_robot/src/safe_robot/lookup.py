"""From a configuration to checks."""

from collections.abc import Mapping
from typing import Any, cast

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.plugins import find_in_table

from .check import Check
from .checks import CHECKS
from .limits import JointLimits
from .robot import GuardedRobot


def check_class(name: str) -> type[Check]:
    """Returns the class of a check.

    Args:
        name: A name of the table `CHECKS`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        ValueError: If another package has no such class.
    """
    return cast(type[Check], find_in_table(name, Check, CHECKS, "check"))


def make_checks(
    options: Mapping[str, Mapping[str, Any]], robot: GuardedRobot, limits: JointLimits, file: str
) -> list[Check]:
    """Returns the checks of a guard: those that are on by default, and those that have options; switched off ones not.

    Args:
        options: Options by name of the check.
        file: Where they come from, for messages.

    Raises:
        ConfigError: If a check is not known, or its options are wrong.
    """
    checks = []
    for name in dict.fromkeys((*CHECKS, *options)):
        try:
            each = check_class(name)
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
