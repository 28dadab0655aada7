"""Check that joint speeds are within their limits."""

import numpy as np

from safe_robot.check import Check, CheckContext, Violation
from safe_robot.motion import CommandedMotion

UNIT = ("rad/s", "m/s")


class JointVelocity(Check):
    """No joint has more velocity than its limit, in the differences of commands a period apart."""

    name = "joint_velocity"
    is_default = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        return self.first_above(np.abs(motion.velocity), self.limits.velocity, "velocity", UNIT)
