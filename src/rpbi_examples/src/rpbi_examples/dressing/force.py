"""Forces that a person's arm feels, against their limits."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence

from operator_node.avatar.segment_forces import LIMITS, REGIONS, SegmentForce

ARM_SEGMENTS = tuple(REGIONS)
MEAN_S = 0.1
"""Contact forces of soft bodies are noisy: their mean over this time is used [s]."""


def forces_on_arm(segments: Sequence[str], sums: Sequence[float], largest: Sequence[float]) -> dict[str, SegmentForce]:
    """Returns the force on each segment of the arm.

    Args:
        segments: Names of n segments of the person.
        sums: Sum of the magnitudes of all contact forces on each (n) [N].
        largest: Largest single one on each (n) [N].

    Raises:
        ValueError: If the lengths differ, a segment of the arm is missing, or a force on it is negative or not finite.
    """
    if not len(segments) == len(sums) == len(largest):
        raise ValueError(
            f"expected a sum and a largest force for each segment, got {len(segments)} segments, {len(sums)} sums and "
            f"{len(largest)} largest forces"
        )
    by_name = {name: SegmentForce(*each) for name, *each in zip(segments, sums, largest)}
    if missing := [name for name in ARM_SEGMENTS if name not in by_name]:
        known = ", ".join(segments) or "none"
        raise ValueError(f"expected the segments {', '.join(ARM_SEGMENTS)}; got {known}, without {', '.join(missing)}")
    found = {name: by_name[name] for name in ARM_SEGMENTS}
    for name, force in found.items():
        if not all(0.0 <= value < math.inf for value in force):
            raise ValueError(
                f"{name}: expected finite forces of 0 N or more, got {force.sum_n:g} and {force.largest_n:g} N"
            )
    return found


class ArmForce:
    """Forces on the arm over the last tenth of a second, as shares of their limits.

    There are three: a single contact may reach the transient limit of its body region, the mean over a segment the
    quasi-static one, and the mean over the whole arm a limit chosen for comfort.

    Args:
        limit_n: Largest sum over the arm [N].

    Attributes:
        arm_n: Sum over the arm, as mean over 0.1 s [N].
        peak_n: Largest of these so far [N].
        share: Largest share of a limit that is used; above 1 it is exceeded.
        peak_share: Largest of these so far.
    """

    def __init__(self, limit_n: float) -> None:
        self._limit_n = limit_n
        self._recent: deque[tuple[float, Mapping[str, SegmentForce]]] = deque()
        self.arm_n = self.peak_n = self.share = self.peak_share = 0.0

    def add(self, time_s: float, forces: Mapping[str, SegmentForce]) -> None:
        """Adds the forces on the segments of the arm at a time [s]."""
        self._recent.append((time_s, forces))
        while self._recent[0][0] < time_s - MEAN_S:
            self._recent.popleft()
        arm_n, shares = 0.0, []
        for name in ARM_SEGMENTS:
            limit = LIMITS[REGIONS[name]]
            recent = [each[name] for _, each in self._recent]
            mean_n = math.fsum(each.sum_n for each in recent) / len(recent)
            shares += [mean_n / limit.quasi_static_n, max(each.largest_n for each in recent) / limit.transient_n]
            arm_n += mean_n
        self.arm_n, self.share = arm_n, max(arm_n / self._limit_n, *shares)
        self.peak_n, self.peak_share = max(self.peak_n, self.arm_n), max(self.peak_share, self.share)
