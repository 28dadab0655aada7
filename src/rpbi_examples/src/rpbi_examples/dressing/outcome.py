"""Evaluation of whether a person is dressed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .force import ArmForce
from .way import ArmPosition, Array

AROUND, RINGS = 14, 12
"""Number of corners of each ring of the sleeve, and number of rings."""
ENOUGH_M = 0.05
"""Distance past the elbow from which the sleeve counts as on [m]."""


class Outcome(NamedTuple):
    """Result of dressing.

    Attributes:
        past_elbow_m: Distance of the middle of the cuff past the elbow, along the upper arm [m].
        is_around: Whether the arm is inside the cuff, and inside the ring of the sleeve that is nearest to the elbow.
        peak_force_n: Largest force on the arm [N]: the sum of all magnitudes, as mean over 0.1 s.
        peak_share: Largest share of a force limit that was reached: of a contact, of a segment or of the arm.
    """

    past_elbow_m: float
    is_around: bool
    peak_force_n: float
    peak_share: float

    @property
    def is_dressed(self) -> bool:
        """Whether the sleeve is past the elbow."""
        return self.is_around and self.past_elbow_m >= ENOUGH_M

    @property
    def is_within_limits(self) -> bool:
        """Whether no force on the arm was ever above its limit."""
        return self.peak_share <= 1.0


def outcome(rings: Array, arm: ArmPosition, force: ArmForce) -> Outcome:
    """Returns the result of dressing.

    Args:
        rings: Rings of the sleeve (11 x 14 x 3) [m].
        arm: Where the person's arm is.
        force: Forces on the arm so far.
    """
    upper_arm = arm.shoulder - arm.elbow
    upper_arm /= np.linalg.norm(upper_arm)
    cuff = rings[0].mean(axis=0)
    past = float(np.dot(cuff - arm.elbow, upper_arm))
    nearest = min(rings, key=lambda ring: math.dist(ring.mean(axis=0), arm.elbow))
    around = _encloses(rings[0], arm.elbow + past * upper_arm, upper_arm) and _encloses(nearest, arm.elbow, upper_arm)
    return Outcome(past, around, force.peak_n, force.peak_share)


def rings_of(corners: ArrayLike) -> Array:
    """Returns the rings of the sleeve but the last (11 x 14 x 3) [m], from the corners of its triangles.

    Raises:
        ValueError: If the number of triangles differs, or a corner is not finite.
    """
    triangles, expected = np.asarray(corners, dtype=float), 2 * AROUND * (RINGS - 1)
    if triangles.size != 9 * expected:
        raise ValueError(f"expected the {expected} triangles of the sleeve, got {triangles.size / 9:g}")
    if not np.isfinite(triangles).all():
        raise ValueError("expected finite corners of the sleeve, got non-finite ones")
    return triangles.reshape(-1, 3, 3)[::2, 0].reshape(RINGS - 1, AROUND, 3)


def _encloses(ring: Array, point: Array, axis: Array) -> bool:
    """Returns whether a ring goes once around a line through a point."""
    across = np.cross(axis, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    beside = ring - point
    angles = np.arctan2(beside @ np.cross(axis, across), beside @ across)
    turns = np.angle(np.exp(1j * np.diff(np.append(angles, angles[0])))).sum() / (2.0 * np.pi)
    return bool(round(abs(turns)) == 1)
