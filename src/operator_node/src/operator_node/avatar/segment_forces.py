"""Forces on the segments of a person's body, and the limits for robots.

Source of the limits: ISO/TS 15066:2016, Annex A, table A.2, column of forces. They are limits for contact with
industrial robots, from the onset of slight injury, not of comfort. The table has a factor of 2 for transient contact,
and none for skull and face, where no transient contact is allowed. Its pressures are left out, since contacts of the
simulation have no area; it has no values for feet.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple


class ForceLimit(NamedTuple):
    """Largest forces on a region of the body.

    Attributes:
        quasi_static_n: Limit for a contact that clamps the region, or that lasts [N].
        transient_n: Limit for a contact from which the region can recoil [N]; 0 where none is allowed.
    """

    quasi_static_n: float
    transient_n: float


LIMITS: Mapping[str, ForceLimit] = {
    "skull and forehead": ForceLimit(130.0, 0.0),
    "face": ForceLimit(65.0, 0.0),
    "neck": ForceLimit(150.0, 300.0),
    "back and shoulders": ForceLimit(210.0, 420.0),
    "chest": ForceLimit(140.0, 280.0),
    "abdomen": ForceLimit(110.0, 220.0),
    "pelvis": ForceLimit(180.0, 360.0),
    "upper arms and elbow joints": ForceLimit(150.0, 300.0),
    "lower arms and wrist joints": ForceLimit(160.0, 320.0),
    "hands and fingers": ForceLimit(140.0, 280.0),
    "thighs and knees": ForceLimit(220.0, 440.0),
    "lower legs": ForceLimit(130.0, 260.0),
}
"""Limits by body region, as the standard names it."""

REGIONS: Mapping[str, str] = {
    "RightShoulder": "back and shoulders",
    "RightUpperArm": "upper arms and elbow joints",
    "RightForeArm": "lower arms and wrist joints",
    "RightHand": "hands and fingers",
}
"""Body region of each segment of the arm that is dressed."""


class SegmentForce(NamedTuple):
    """Forces on a segment of the body in one tick, as magnitudes: forces from opposite sides do not cancel.

    Attributes:
        sum_n: Sum over all contacts [N].
        largest_n: Largest force of a single contact [N].
    """

    sum_n: float
    largest_n: float


def forces_by_segment(
    segments: Iterable[str], contacts: Iterable[tuple[str, Sequence[float]]]
) -> dict[str, SegmentForce]:
    """Returns the force on each segment.

    Args:
        segments: Their names.
        contacts: Segment and force (3) [N] of each contact; those of other segments are ignored.
    """
    sizes: dict[str, list[float]] = {name: [] for name in segments}
    for segment, force in contacts:
        if segment in sizes:
            sizes[segment].append(math.hypot(*force))
    return {name: SegmentForce(math.fsum(found), max(found, default=0.0)) for name, found in sizes.items()}
