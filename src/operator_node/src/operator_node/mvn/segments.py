"""A person as MVN measures them: 23 rigid segments."""

from typing import NamedTuple

import numpy as np

SEGMENTS = (
    "Pelvis",
    "L5",
    "L3",
    "T12",
    "T8",
    "Neck",
    "Head",
    "RightShoulder",
    "RightUpperArm",
    "RightForeArm",
    "RightHand",
    "LeftShoulder",
    "LeftUpperArm",
    "LeftForeArm",
    "LeftHand",
    "RightUpperLeg",
    "RightLowerLeg",
    "RightFoot",
    "RightToe",
    "LeftUpperLeg",
    "LeftLowerLeg",
    "LeftFoot",
    "LeftToe",
)
"""Names of the segments in the order of the stream, whose ids begin at 1 (MVN network streaming protocol, rev. N)."""


class SegmentFrame(NamedTuple):
    """All segments of one person at one moment.

    The origin of a segment is the centre of the joint towards the pelvis. In the T-pose all are turned alike:
    x forward, y left, z up.

    Attributes:
        person: Number of the person, from 0.
        sample: Counter of the frame.
        time_ms: Time since the recording began [ms].
        positions: Origins in the world (23 x 3) [m].
        quats_xyzw: Orientations in the world (23 x 4), unit quaternions x, y, z, w.
    """

    person: int
    sample: int
    time_ms: int
    positions: np.ndarray
    quats_xyzw: np.ndarray
