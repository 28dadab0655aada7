"""Check that joint jerks are within their limits."""

import numpy as np

from safe_robot.check import Check, CheckContext, Violation
from safe_robot.motion import CommandedMotion

UNIT = ("rad/s^3", "m/s^3")


class JointJerk(Check):
    """Checks that no joint exceeds its jerk limit, according to differences of successive commands."""

    name = "joint_jerk"
    is_default = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        return self.first_above(np.abs(motion.jerk), self.limits.jerk, "jerk", UNIT)
