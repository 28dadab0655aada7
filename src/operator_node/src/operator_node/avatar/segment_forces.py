"""Forces on the segments of a person's body, and limits of the forces that robots may exert.

Source of the limits: ISO/TS 15066:2016, Annex A, table A.2, column of forces. The limits hold for contact with
industrial robots. They mark the onset of slight injury, not of discomfort. The limits for transient contact are twice
as high, except for skull and face, where transient contact is not allowed. The table's pressures are not used, because
contacts in the simulation have no area. The table has no values for feet.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple


class ForceLimit(NamedTuple):
    """Largest forces on a region of the body.

    Attributes:
        quasi_static_n: Limit for a contact that lasts, or that clamps the region [N].
        transient_n: Limit for a short contact from which the region can recoil [N]; 0 if such contact is not allowed.
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
"""Limits, keyed by the standard's name of the body region."""

REGIONS: Mapping[str, str] = {
    "RightShoulder": "back and shoulders",
    "RightUpperArm": "upper arms and elbow joints",
    "RightForeArm": "lower arms and wrist joints",
    "RightHand": "hands and fingers",
}
"""Body region of each segment of the right arm, which the robot dresses."""


class SegmentForce(NamedTuple):
    """Magnitudes of the forces on a segment of the body in one tick. Forces from opposite sides do not cancel.

    Attributes:
        sum_n: Sum over all contacts [N].
        largest_n: Largest force of a single contact [N].
    """

    sum_n: float
    largest_n: float


def forces_by_segment(
    segments: Iterable[str], contacts: Iterable[tuple[str, Sequence[float]]]
) -> dict[str, SegmentForce]:
    """Returns the forces on each segment, keyed by the segment's name.

    Args:
        segments: Names of the segments.
        contacts: Segment and force (3) [N] of each contact. Contacts of other segments are ignored.
    """
    sizes: dict[str, list[float]] = {name: [] for name in segments}
    for segment, force in contacts:
        if segment in sizes:
            sizes[segment].append(math.hypot(*force))
    return {name: SegmentForce(math.fsum(found), max(found, default=0.0)) for name, found in sizes.items()}
