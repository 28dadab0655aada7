"""Body dimensions and masses of people, from published tables.

- Drillis and Contini (1966), as Winter prints them (Biomechanics and Motor Control of Human Movement, 4th ed. 2009,
  fig. 4.1): lengths of limbs as fractions of the height.
- de Leva (1996), Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters, J. Biomechanics 29(9), table 4, men:
  masses, centres of mass, radii of gyration, and the division of trunk and head.
- Dempster (1955), as in Winter's table 4.1: densities.
- Bell, Pedersen and Brand (1990), J. Biomechanics 23(6): position of the hip joints between the iliac spines.

Some parts of the tables cover several segments of `SEGMENTS`. How the values are divided among these segments is our
own choice. Vectors have the components x (forward), y (left) and z (up), for a person in the T-pose.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from operator_node.mvn.segments import BONES, SEGMENTS, SegmentFrame

Array = NDArray[np.float64]

HIP_HEIGHT, SHOULDER_HEIGHT, ANKLE_HEIGHT = 0.530, 0.818, 0.039
THIGH, SHANK, UPPER_ARM, FOREARM, HAND = 0.245, 0.246, 0.186, 0.146, 0.108
SHOULDER_HALF_BREADTH, CHEST_BREADTH, HIP_BREADTH = 0.129, 0.174, 0.191
FOOT_LENGTH, FOOT_BREADTH = 0.152, 0.055
"""Lengths as fractions of the body height (Drillis and Contini)."""
HEEL, BALL = 0.038, 0.073
"""Distance from the ankle back to the heel, and forward to the ball of the foot, as fractions of the body height.

They are a quarter and about half of the foot's length.
"""
HIP_HALF_WIDTH = 0.049
"""Half the distance between the hip joints, as a fraction of the body height.

The hip joints are 0.72 times as far apart as the iliac spines (Bell), which are about 0.24 m apart at 1.75 m height.
"""

_LOWER, _MIDDLE, _UPPER, _HEAD = 145.7, 215.5, 242.1, 242.9
"""Lengths from hip to navel, to lower end of the breastbone, to seventh cervical vertebra, to crown [mm] (de Leva)."""
_ABOVE_HIPS = (1.0 - HIP_HEIGHT) / (_LOWER + _MIDDLE + _UPPER + _HEAD)
LOWER_TRUNK, MIDDLE_TRUNK, UPPER_TRUNK, HEAD_AND_NECK = (
    _ABOVE_HIPS * part for part in (_LOWER, _MIDDLE, _UPPER, _HEAD)
)
"""Lengths of trunk and head as fractions of the body height. Together, they reach from the hips to the crown."""
PELVIS_SHARE, NECK_SHARE = 0.6, 0.37
"""Share of the pelvis in the lower trunk's length, and share of the neck in the common length of head and neck."""
CLAVICLE_Y = 0.02
"""Distance of the shoulder girdles' origins from the sagittal plane, as a fraction of the body height."""

_SPINE_TO_SHOULDERS = SHOULDER_HEIGHT - HIP_HEIGHT - LOWER_TRUNK - MIDDLE_TRUNK
_RIGHT_LIMBS: dict[str, tuple[float, float, float]] = {
    "Shoulder": (0.0, -CLAVICLE_Y, _SPINE_TO_SHOULDERS),
    "UpperArm": (0.0, CLAVICLE_Y - SHOULDER_HALF_BREADTH, 0.0),
    "ForeArm": (0.0, -UPPER_ARM, 0.0),
    "Hand": (0.0, -FOREARM, 0.0),
    "UpperLeg": (0.0, -HIP_HALF_WIDTH, 0.0),
    "LowerLeg": (0.0, 0.0, -THIGH),
    "Foot": (0.0, 0.0, -SHANK),
    "Toe": (BALL, 0.0, 0.009 - ANKLE_HEIGHT),
}
_OFFSETS: dict[str, tuple[float, float, float]] = {
    "Pelvis": (0.0, 0.0, 0.0),
    "L5": (0.0, 0.0, PELVIS_SHARE * LOWER_TRUNK),
    "L3": (0.0, 0.0, (1.0 - PELVIS_SHARE) * LOWER_TRUNK),
    "T12": (0.0, 0.0, MIDDLE_TRUNK / 2.0),
    "T8": (0.0, 0.0, MIDDLE_TRUNK / 2.0),
    "Neck": (0.0, 0.0, UPPER_TRUNK),
    "Head": (0.0, 0.0, NECK_SHARE * HEAD_AND_NECK),
    **{f"Right{name}": offset for name, offset in _RIGHT_LIMBS.items()},
    **{f"Left{name}": (x, -y, z) for name, (x, y, z) in _RIGHT_LIMBS.items()},
}
"""Origin of each segment in its parent's frame, as fractions of the body height."""

_LIMB_MASSES = {
    "Shoulder": 0.1 * 15.96,
    "UpperArm": 2.71,
    "ForeArm": 1.62,
    "Hand": 0.61,
    "UpperLeg": 14.16,
    "LowerLeg": 4.33,
    "Foot": 0.8 * 1.37,
    "Toe": 0.2 * 1.37,
}
MASS_PERCENT: dict[str, float] = {
    "Pelvis": PELVIS_SHARE * 11.17,
    "L5": (1.0 - PELVIS_SHARE) * 11.17,
    "L3": 16.33 / 2.0,
    "T12": 16.33 / 2.0,
    "T8": 0.8 * 15.96,
    "Neck": 0.2 * 6.94,
    "Head": 0.8 * 6.94,
    **{f"{side}{name}": mass for side in ("Right", "Left") for name, mass in _LIMB_MASSES.items()},
}
"""Mass of each segment in percent of the body mass. The sum is 100."""

_TRUNK, _HEAD_DENSITY = 1030.0, 1110.0
_LIMB_DENSITIES = {
    "Shoulder": _TRUNK,
    "UpperArm": 1070.0,
    "ForeArm": 1130.0,
    "Hand": 1160.0,
    "UpperLeg": 1050.0,
    "LowerLeg": 1090.0,
    "Foot": 1100.0,
    "Toe": 1100.0,
}
DENSITY: dict[str, float] = {
    **dict.fromkeys(("Pelvis", "L5", "L3", "T12", "T8"), _TRUNK),
    **dict.fromkeys(("Neck", "Head"), _HEAD_DENSITY),
    **{f"{side}{name}": density for side in ("Right", "Left") for name, density in _LIMB_DENSITIES.items()},
}
"""Density of each segment [kg/m^3]. Mass, length and density determine the segment's thickness."""


class Gyration(NamedTuple):
    """Mass distribution of a limb. All values are fractions of the limb's length.

    Attributes:
        centre: Distance of the centre of mass from the limb's joint on the side of the trunk.
        across: Radius of gyration about the axes across the limb. It is the mean of the table's two similar values.
        along: Radius of gyration about the limb's longitudinal axis.
    """

    centre: float
    across: float
    along: float


GYRATION: dict[str, Gyration] = {
    "UpperArm": Gyration(0.5772, (0.285 + 0.269) / 2.0, 0.158),
    "ForeArm": Gyration(0.4574, (0.276 + 0.265) / 2.0, 0.121),
    "Hand": Gyration(0.3624, (0.288 + 0.235) / 2.0, 0.184),
    "UpperLeg": Gyration(0.4095, 0.329, 0.149),
    "LowerLeg": Gyration(0.4395, (0.251 + 0.246) / 2.0, 0.102),
}
"""Mass distribution of the limbs that consist of one segment, keyed by name without the side (de Leva)."""


def segment_offsets(height_m: float) -> Array:
    """Returns the origin of each segment in its parent's frame (23 x 3) [m]. The row of the pelvis is 0.

    Args:
        height_m: Height of the person [m].
    """
    return height_m * np.array([_OFFSETS[name] for name in SEGMENTS])


def measured_offsets(frame: SegmentFrame) -> Array:
    """Returns the origin of each segment in its parent's frame (23 x 3) [m].

    Args:
        frame: Motion-capture frame of the person, in any pose.
    """
    offsets = np.zeros((len(SEGMENTS), 3))
    parents, children = BONES.T
    vectors = frame.positions[children] - frame.positions[parents]
    offsets[children] = Rotation.from_quat(frame.quats_xyzw[parents]).inv().apply(vectors)
    return offsets


def leg_length(offsets: Array) -> float:
    """Returns the length of thigh plus shank, as the mean of both legs [m].

    Args:
        offsets: Origin of each segment in its parent's frame (23 x 3) [m].
    """
    legs = [SEGMENTS.index(f"{side}{part}") for side in ("Right", "Left") for part in ("LowerLeg", "Foot")]
    return float(np.linalg.norm(offsets[legs], axis=1).sum() / 2.0)
