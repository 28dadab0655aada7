"""Result of dressing a person: forces on the arm compared to their limits, and the position of the sleeve."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from operator_node.avatar.segment_forces import LIMITS, REGIONS, SegmentForce

from .cuff_path import ArmPosition, Array

ARM_SEGMENTS = tuple(REGIONS)
MEAN_S = 0.1
"""Time over which contact forces are averaged [s], since soft bodies have noisy contact forces."""
AROUND, RINGS = 14, 12
"""Number of corners in each ring of the sleeve, and number of rings."""
ENOUGH_M = 0.05
"""Least distance of the cuff past the elbow at which the person counts as dressed [m]."""


def forces_on_arm(segments: Sequence[str], sums: Sequence[float], largest: Sequence[float]) -> dict[str, SegmentForce]:
    """Checks the contact forces, and returns the forces on the arm, indexed by segment name.

    Args:
        segments: Names of n segments of the person.
        sums: Sum of the magnitudes of all contact forces on each segment, shape (n,) [N].
        largest: Magnitude of the largest contact force on each segment, shape (n,) [N].

    Raises:
        ValueError: If the lengths differ, a segment of the arm is missing, or a force on the arm is negative or not
            finite.
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
    """Compares the forces on the arm over the last `MEAN_S` with their limits.

    Three forces have limits:

    - The force of a single contact must not exceed the transient limit of the contact's body region.
    - The mean force on a segment must not exceed the quasi-static limit of the segment's body region.
    - The mean force on the whole arm must not exceed `limit_n`, which is chosen for comfort.

    Args:
        limit_n: Limit of the mean force on the whole arm [N].

    Attributes:
        arm_n: Sum of the forces on the arm, averaged over `MEAN_S` [N].
        peak_n: Largest `arm_n` so far [N].
        share: Largest ratio of a force to its limit. Above 1, a limit is exceeded.
        peak_share: Largest `share` so far.
    """

    def __init__(self, limit_n: float) -> None:
        self._limit_n = limit_n
        self._recent: deque[tuple[float, Mapping[str, SegmentForce]]] = deque()
        self.arm_n = self.peak_n = self.share = self.peak_share = 0.0

    def add(self, time_s: float, forces: Mapping[str, SegmentForce]) -> None:
        """Adds the forces at a time [s], indexed by segment name, and updates the attributes."""
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


class Outcome(NamedTuple):
    """Result of dressing.

    Attributes:
        past_elbow_m: Distance of the middle of the cuff past the elbow, along the upper arm [m].
        is_around: Whether the arm is inside the cuff, and inside the ring of the sleeve that is nearest to the elbow.
        peak_force_n: Largest force on the arm [N]; see `ArmForce.peak_n`.
        peak_share: Largest ratio of a force to its limit; see `ArmForce`.
    """

    past_elbow_m: float
    is_around: bool
    peak_force_n: float
    peak_share: float

    @property
    def is_dressed(self) -> bool:
        """Whether the sleeve is around the arm and at least `ENOUGH_M` past the elbow."""
        return self.is_around and self.past_elbow_m >= ENOUGH_M

    @property
    def is_within_limits(self) -> bool:
        """Whether all forces on the arm stayed within their limits."""
        return self.peak_share <= 1.0


def outcome(rings: Array, arm: ArmPosition, force: ArmForce) -> Outcome:
    """Computes the result of dressing.

    Args:
        rings: Corners of the sleeve's rings, shape (11, 14, 3) [m]. The first ring is the cuff.
        arm: Positions of shoulder, elbow and wrist of the person's arm.
        force: Forces on the arm during the whole trial.
    """
    upper_arm = arm.shoulder - arm.elbow
    upper_arm /= np.linalg.norm(upper_arm)
    cuff = rings[0].mean(axis=0)
    past = float(np.dot(cuff - arm.elbow, upper_arm))
    nearest = min(rings, key=lambda ring: math.dist(ring.mean(axis=0), arm.elbow))
    around = _encloses(rings[0], arm.elbow + past * upper_arm, upper_arm) and _encloses(nearest, arm.elbow, upper_arm)
    return Outcome(past, around, force.peak_n, force.peak_share)


def rings_of(corners: ArrayLike) -> Array:
    """Extracts a sleeve's rings from the corners of the sleeve's triangles.

    Args:
        corners: Coordinates of the triangles' corners, 9 numbers per triangle, as an array of any shape [m].

    Returns:
        Corners of all rings except the last, shape (11, 14, 3) [m].

    Raises:
        ValueError: If the number of triangles is wrong, or a corner is not finite.
    """
    triangles, expected = np.asarray(corners, dtype=float), 2 * AROUND * (RINGS - 1)
    if triangles.size != 9 * expected:
        raise ValueError(f"expected the {expected} triangles of the sleeve, got {triangles.size / 9:g}")
    if not np.isfinite(triangles).all():
        raise ValueError("expected finite corners of the sleeve, got non-finite ones")
    return triangles.reshape(-1, 3, 3)[::2, 0].reshape(RINGS - 1, AROUND, 3)


def _encloses(ring: Array, point: Array, axis: Array) -> bool:
    """Returns whether a ring winds around a line exactly once.

    Args:
        ring: Corners of the ring, shape (14, 3) [m].
        point: A point of the line, shape (3,) [m].
        axis: Direction of the line, which must not be vertical; a unit vector of shape (3,).
    """
    across = np.cross(axis, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    beside = ring - point
    angles = np.arctan2(beside @ np.cross(axis, across), beside @ across)
    turns = np.angle(np.exp(1j * np.diff(np.append(angles, angles[0])))).sum() / (2.0 * np.pi)
    return bool(round(abs(turns)) == 1)
