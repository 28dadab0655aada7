"""Check of measured forces and torques."""

import math

from pydantic import Field

from custom_ros_tools.schema import Positive, Seconds
from safe_robot.check import Check, CheckConfig, CheckContext, Violation
from safe_robot.motion import CommandedMotion


class ForceConfig(CheckConfig):
    """Limits on the force and torque that a sensor measures."""

    force_n: Positive = Field(50.0, description="Largest measured force [N].")
    torque_nm: Positive = Field(10.0, description="Largest measured torque [N m].")
    timeout_s: Seconds = Field(0.1, description="Largest age of the measurement.")


class Force(Check):
    """Checks that the measured force and torque are within their limits, and that the measurement is recent."""

    Config = ForceConfig
    name = "force"
    watches = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        config = self.config
        if not context.wrench_age_s <= config.timeout_s:
            return Violation(self.name, "the age of the wrench", context.wrench_age_s, config.timeout_s, "s")
        for subject, values, limit, unit in (
            ("the force", context.wrench[:3], config.force_n, "N"),
            ("the torque", context.wrench[3:], config.torque_nm, "N m"),
        ):
            size = math.hypot(*values)
            if not size <= limit:
                return Violation(self.name, subject, size, limit, unit)
        return None
