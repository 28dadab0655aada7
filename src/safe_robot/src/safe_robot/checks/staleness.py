"""Check that targets are recent, and that their stamps do not decrease."""

from pydantic import Field

from custom_ros_tools.schema import Seconds
from safe_robot.check import Check, CheckConfig, CheckContext, Violation
from safe_robot.motion import CommandedMotion


class StalenessConfig(CheckConfig):
    """Limit on the age of targets and on the time without a target."""

    timeout_s: Seconds = Field(
        0.1, description="Largest age of a target, and longest time without a target while the robot moves."
    )


class Staleness(Check):
    """Checks that targets are recent, that stamps do not decrease, and that targets keep arriving during a motion."""

    Config = StalenessConfig
    name = "staleness"
    watches = True
    is_default = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        timeout_s = self.config.timeout_s
        if not abs(context.age_s) <= timeout_s:
            return too_old(context.age_s, timeout_s, "checks.staleness.timeout_s")
        step_s = context.stamp_step_s
        if step_s is not None and not step_s >= 0.0:
            words = (
                f"the stamp of the target is {-step_s:.3g} s earlier than that of the previous target; give each target"
                " a later stamp, or none, and let only one source publish"
            )
            return Violation(self.name, "the stamp, after that of the target before,", step_s, 0.0, "s", words=words)
        if not motion.start.is_at_rest and not context.since_command_s <= timeout_s:
            since_s = context.since_command_s
            words = (
                f"no target for {since_s:.3g} s while the robot moves, limit {timeout_s:.6g} s; publish until it"
                " rests, or raise checks.staleness.timeout_s"
            )
            return Violation(self.name, "the time without a target", since_s, timeout_s, "s", words=words)
        return None


def too_old(age_s: float, limit_s: float, key: str) -> Violation:
    """Returns the violation of a target whose age [s] exceeds a limit [s]; `key` names the parameter with the limit."""
    if age_s < 0.0:
        words = (
            f"the stamp of the target is {-age_s:.3g} s in the future, limit {limit_s:.6g} s; synchronise the clocks"
        )
    else:
        words = (
            f"the target is {age_s:.3g} s old, limit {limit_s:.6g} s; synchronise the clocks, publish targets sooner,"
            f" or raise {key}"
        )
    return Violation(Staleness.name, "the age of the target", age_s, limit_s, "s", words=words)
