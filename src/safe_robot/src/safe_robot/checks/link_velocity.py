"""Check that the speeds of links are within their limits."""

from typing import Any

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Positive
from robot_model.model import RobotModel
from safe_robot.check import Check, CheckConfig, CheckContext, Violation
from safe_robot.limits import MotionLimits
from safe_robot.motion import CommandedMotion


class LinkVelocityConfig(CheckConfig):
    """Speed limits of links."""

    links: dict[str, Positive] = Field({}, description="Largest speed of a link's origin [m/s], keyed by link name.")


class LinkVelocity(Check):
    """Checks that the origins of links keep their speed limits, also while the robot brakes."""

    Config = LinkVelocityConfig
    name = "link_velocity"

    def __init__(self, config: Any, robot: RobotModel, limits: MotionLimits, file: str) -> None:
        super().__init__(config, robot, limits, file)
        self._reach: dict[str, np.ndarray] = {}  # largest link motion per rad or m of each joint
        for link in config.links:
            self.require_link(link, "links")
            self._reach[link] = robot.reach(link, 0.0)

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        for link, limit in self.config.links.items():
            if (np.abs(motion.velocity) @ self._reach[link]).max() <= limit:  # upper bound of the speed
                continue
            position = motion.link_positions(link)
            step = position[1:] - position[:-1]
            speed = np.sqrt((step * step).sum(axis=1)) / motion.period_s
            is_slow = speed <= limit
            if not is_slow.all():
                row = int(np.argmin(is_slow))
                return Violation(self.name, f"link '{link}'", float(speed[row]), limit, "m/s", row > 0, "speed")
        return None
