"""How well the robot follows its commands."""

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import NonNegative, Positive, Seconds
from safe_robot.check import Check, CheckConfig, Situation, Violation
from safe_robot.motion import Motion


class TrackingConfig(CheckConfig):
    """How far measured positions may be from commands."""

    tolerance: Positive = Field(0.1, description="Largest distance between command and measured position [rad or m].")
    lag_s: NonNegative = Field(
        0.0, description="How late the robot is where it follows [s]: so much of its speed it may be behind beside."
    )
    timeout_s: Seconds = Field(0.1, description="Oldest measured positions.")


class Tracking(Check):
    """Measured positions are near the last command, but for what the robot is late, and not old."""

    Config = TrackingConfig
    name = "tracking"
    watches = True

    def check(self, motion: Motion, situation: Situation) -> Violation | None:
        """See `Check`."""
        if not (situation.measured and situation.measured_age_s <= self.config.timeout_s):
            age_s = situation.measured_age_s if situation.measured else float("inf")
            return Violation(self.name, "the age of measured positions", age_s, self.config.timeout_s, "s")
        measured = np.array([situation.measured.get(name, np.nan) for name in self.robot.joint_names])
        expected = motion.start.position - self.config.lag_s * motion.start.velocity
        error = np.abs(measured - expected)[None]
        return self.first_above(error, np.full(error.shape[1], self.config.tolerance), "error", ("rad", "m"))
