"""Sends what the core logs to the console and to /rosout."""

from __future__ import annotations

import logging
from collections.abc import Callable

import rospy

PACKAGES = ("custom_ros_tools", "rpbi", "ik_ros", "rpbi_utils", "rpbi_examples")
"""Those of this workspace."""


class _RosHandler(logging.Handler):
    """Hands log records to rospy."""

    def emit(self, record: logging.LogRecord) -> None:
        levels: tuple[tuple[int, Callable[[str], None]], ...] = (
            (logging.CRITICAL, rospy.logfatal),
            (logging.ERROR, rospy.logerr),
            (logging.WARNING, rospy.logwarn),
            (logging.INFO, rospy.loginfo),
            (logging.DEBUG, rospy.logdebug),
        )
        text = self.format(record)
        next(send for level, send in levels if record.levelno >= level)(text)


def attach_logging(*modules: str) -> None:
    """Attaches the loggers of some modules to /rosout; call it once, after `rospy.init_node`.

    Args:
        modules: Top-level Python modules, such as `rpbi`; without any, all of this workspace.
    """
    handler = _RosHandler(level=logging.DEBUG)
    for module in modules or PACKAGES:
        logger = logging.getLogger(module)
        logger.setLevel(logging.INFO)
        logger.propagate = False
        logger.addHandler(handler)
