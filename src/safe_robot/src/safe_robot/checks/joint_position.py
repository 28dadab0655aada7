"""Check that joint positions are within their limits."""

import numpy as np

from safe_robot.check import Check, CheckContext, Violation
from safe_robot.motion import CommandedMotion

UNIT = ("rad", "m")


class JointPosition(Check):
    """Checks that all joints stay within their position limits, also while the robot brakes."""

    name = "joint_position"
    is_default = True

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        q, before = motion.position, motion.start.position
        low, high = np.minimum(self.limits.lower, before), np.maximum(self.limits.upper, before)
        is_inside = (q >= low) & (q <= high)
        if is_inside.all():
            return None
        row, i = divmod(int(np.argmin(is_inside)), q.shape[1])
        limit = self.limits.lower[i] if q[row, i] < low[i] else self.limits.upper[i]
        return self.of_joint(i, float(q[row, i]), float(limit), "position", UNIT, row > 0)
