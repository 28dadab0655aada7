"""Targets that come too late, or whose time jumps."""

from pydantic import Field

from custom_ros_tools.schema import Seconds
from safe_robot.check import Check, CheckConfig, Situation, Violation
from safe_robot.motion import Motion


class StalenessConfig(CheckConfig):
    """How late a target may be."""

    timeout_s: Seconds = Field(0.1, description="Oldest target; and longest time without one while the robot moves.")


class Staleness(Check):
    """Targets are fresh, in order, and do not fail to come while the robot moves."""

    Config = StalenessConfig
    name = "staleness"
    watches = True
    is_default = True

    def check(self, motion: Motion, situation: Situation) -> Violation | None:
        """See `Check`."""
        timeout_s = self.config.timeout_s
        if not abs(situation.age_s) <= timeout_s:
            return Violation(self.name, "the age of the target", situation.age_s, timeout_s, "s")
        step_s = situation.stamp_step_s
        if step_s is not None and not step_s > 0.0:
            return Violation(self.name, "the stamp, after that of the target before,", step_s, 0.0, "s")
        if not motion.start.is_at_rest and not situation.since_command_s <= timeout_s:
            since_s = situation.since_command_s
            return Violation(self.name, "the time without a target while the robot moves", since_s, timeout_s, "s")
        return None
