"""Reports of joints beyond their limits, which do not flood."""

import logging
import time

from rpbi.urdf.joints import Joint

log = logging.getLogger(__name__)

PERIOD_S = 5.0
"""Shortest time between two reports of one joint [s] of wall time."""


class LimitReports:
    """Reports when a joint goes beyond its limits, once until it has come back, and not more often than now and then.

    Args:
        name: The robot.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._beyond: set[int] = set()
        self._reported_s: dict[int, float] = {}

    def take(self, joint: Joint, position: float, what: str) -> None:
        """Looks at a position [rad or m]; `what` tells what becomes of it, such as `is shown so`."""
        if joint.allows(position):
            self._beyond.discard(joint.index)
            return
        now_s = time.monotonic()
        last_s = self._reported_s.get(joint.index, -PERIOD_S)
        if joint.index not in self._beyond and now_s - last_s >= PERIOD_S:
            log.warning("%s: %s; %s", self._name, joint.limit_violation(position), what)
            self._reported_s[joint.index] = now_s
        self._beyond.add(joint.index)
