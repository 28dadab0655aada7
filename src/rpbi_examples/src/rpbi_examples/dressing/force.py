"""The force that a person's arm feels."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .way import Array

ARM_SEGMENTS = ("RightShoulder", "RightUpperArm", "RightForeArm", "RightHand")
MEAN_S = 0.1
"""Contact forces of soft bodies are rough: their mean over this time counts [s]."""


class MeanForce:
    """The mean of a force over the last tenth of a second, and its largest value."""

    def __init__(self) -> None:
        self._values: deque[tuple[float, Array]] = deque()
        self.peak_n = 0.0

    def add(self, time_s: float, force: ArrayLike) -> float:
        """Takes a force [N] at a time and returns the size of the mean [N]."""
        self._values.append((time_s, np.asarray(force, dtype=float)))
        while self._values[0][0] < time_s - MEAN_S:
            self._values.popleft()
        size = float(np.linalg.norm(np.mean([value for _, value in self._values], axis=0)))
        self.peak_n = max(self.peak_n, size)
        return size


def force_on_arm(segments: Sequence[str], forces: Sequence[Sequence[float]]) -> Array:
    """Returns the sum of forces on the arm (3) [N].

    Args:
        segments: Names of n segments of the person.
        forces: What each feels (n x 3) [N].

    Raises:
        ValueError: If there are more of one than of the other, a segment of the arm is missing, or a force on it is
            not finite.
    """
    if len(segments) != len(forces):
        raise ValueError(f"expected a force for each segment, got {len(segments)} segments and {len(forces)} forces")
    by_name = dict(zip(segments, forces))
    if missing := [name for name in ARM_SEGMENTS if name not in by_name]:
        known = ", ".join(segments) or "none"
        raise ValueError(f"expected the segments {', '.join(ARM_SEGMENTS)}; got {known}, without {', '.join(missing)}")
    total = np.sum([by_name[name] for name in ARM_SEGMENTS], axis=0)
    if not np.isfinite(total).all():
        raise ValueError(f"expected finite forces on the arm, got a sum of {total.tolist()} N")
    return total
