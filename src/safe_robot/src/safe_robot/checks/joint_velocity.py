"""Check that joint speeds are within their limits."""

import numpy as np

from safe_robot.check import Check, CheckContext, Violation
from safe_robot.motion import CommandedMotion

UNIT = ("rad/s", "m/s")


class JointVelocity(Check):
    """Checks that no joint exceeds its speed limit, according to differences of successive commands."""

    name = "joint_velocity"
    is_default = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        return self.first_above(np.abs(motion.velocity), self.limits.velocity, "velocity", UNIT)
