"""Check of the distance between measured positions and commands."""

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import NonNegative, Positive, Seconds
from safe_robot.check import Check, CheckConfig, CheckContext, Violation
from safe_robot.motion import CommandedMotion


class TrackingConfig(CheckConfig):
    """Limits on the difference between measured positions and commands."""

    tolerance: Positive = Field(0.1, description="Largest distance between commanded and measured position [rad or m].")
    lag_s: NonNegative = Field(
        0.0,
        description="Delay with which the robot follows commands [s]. The distance that a joint covers in this time "
        "is added to the tolerance.",
    )
    timeout_s: Seconds = Field(0.1, description="Largest age of measured positions.")


class Tracking(Check):
    """Checks that measured positions are recent and near the last command, with allowance for the robot's lag."""

    Config = TrackingConfig
    name = "tracking"
    watches = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        if not (context.measured and context.measured_age_s <= self.config.timeout_s):
            age_s = context.measured_age_s if context.measured else float("inf")
            return Violation(self.name, "the age of measured positions", age_s, self.config.timeout_s, "s")
        measured = np.array([context.measured.get(name, np.nan) for name in self.robot.joint_names])
        expected = motion.start.position - self.config.lag_s * motion.start.velocity
        error = np.abs(measured - expected)[None]
        return self.first_above(error, np.full(error.shape[1], self.config.tolerance), "error", ("rad", "m"))
