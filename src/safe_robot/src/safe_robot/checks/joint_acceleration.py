"""Check that joint accelerations are within their limits."""

import numpy as np

from safe_robot.check import Check, CheckContext, Violation
from safe_robot.motion import CommandedMotion

UNIT = ("rad/s^2", "m/s^2")


class JointAcceleration(Check):
    """Checks that no joint exceeds its acceleration limit, according to differences of successive commands."""

    name = "joint_acceleration"
    is_default = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        return self.first_above(np.abs(motion.acceleration), self.limits.acceleration, "acceleration", UNIT)
