"""Names and structure of the 23 rigid segments of a person, and the types of MVN's messages."""

from typing import NamedTuple

import numpy as np

from custom_ros_tools.transforms import Array

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
"""Names of the segments in the order of the stream (MVN network streaming protocol, rev. N). Ids start at 1."""
INDEX = {name: index for index, name in enumerate(SEGMENTS)}
PARENTS = tuple(
    -1 if parent is None else INDEX[parent]
    for parent in (
        *(None, "Pelvis", "L5", "L3", "T12", "T8", "Neck"),
        *("T8", "RightShoulder", "RightUpperArm", "RightForeArm"),
        *("T8", "LeftShoulder", "LeftUpperArm", "LeftForeArm"),
        *("Pelvis", "RightUpperLeg", "RightLowerLeg", "RightFoot"),
        *("Pelvis", "LeftUpperLeg", "LeftLowerLeg", "LeftFoot"),
    )
)
"""Index of each segment's parent; -1 for the pelvis."""
BONES = np.array([(parent, child) for child, parent in enumerate(PARENTS) if parent >= 0])
"""Indices of the segments whose origins each bone connects, parent first (22 x 2).

A bone is rigid, and rotates with its parent segment.
"""


class SegmentFrame(NamedTuple):
    """All segments of one person at one moment.

    The origin of a segment is the centre of its joint towards the pelvis. In the T-pose, all segments have the same
    orientation: x forward, y left, z up.

    Attributes:
        person: Number of the person, from 0.
        sample: Sample counter of the frame.
        time_ms: Time since the recording began [ms].
        positions: Origins of the segments in the world (23 x 3) [m].
        quats_xyzw: Orientations of the segments in the world (23 x 4), unit quaternions x, y, z, w.
    """

    person: int
    sample: int
    time_ms: int
    positions: np.ndarray
    quats_xyzw: np.ndarray


class JointAngles(NamedTuple):
    """Angles of a person's joints (type 20).

    Attributes:
        person: Number of the person, from 0.
        sample: Sample counter of the frame.
        parents: For each joint, name of the segment towards the pelvis.
        children: For each joint, name of the segment away from the pelvis.
        angles_rad: Angles of each joint about x, y and z (n x 3) [rad].
    """

    person: int
    sample: int
    parents: tuple[str, ...]
    children: tuple[str, ...]
    angles_rad: Array


class CenterOfMass(NamedTuple):
    """A person's centre of mass in the world (3) [m] (type 24)."""

    person: int
    sample: int
    position: Array


class SegmentMotion(NamedTuple):
    """Motion of segments or trackers in MVN's own units (types 21, 22 and 23).

    Attributes:
        person: Number of the person, from 0.
        sample: Sample counter of the frame.
        kind: Message type, which defines the columns of `values`. Type 21: position, velocity, acceleration
            [m, m/s, m/s2]. Type 22: quaternion w, x, y, z, angular velocity, angular acceleration [deg/s, deg/s2].
            Type 23: quaternion w, x, y, z, acceleration, magnetic field.
        ids: Ids of the n segments, from 1, or of the n trackers.
        values: Values of each segment or tracker (n x m), in the order of `ids`.
    """

    person: int
    sample: int
    kind: int
    ids: tuple[int, ...]
    values: Array


class PersonInfo(NamedTuple):
    """Descriptive fields of a person, keyed by names such as `name` and `color` (type 12)."""

    person: int
    fields: dict[str, str]


class TPose(NamedTuple):
    """Origins of a person's segments in the T-pose [m], keyed by segment (type 13)."""

    person: int
    origins: dict[str, tuple[float, float, float]]


class TimeCode(NamedTuple):
    """Time of day of a sample, as HH:MM:SS.mmm (type 25)."""

    person: int
    sample: int
    time: str


Message = SegmentFrame | JointAngles | CenterOfMass | SegmentMotion | PersonInfo | TPose | TimeCode
