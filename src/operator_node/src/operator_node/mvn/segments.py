"""The 23 rigid segments of a person, and the messages of MVN about a person."""

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
"""Names of the segments in the order of the stream, whose ids start at 1 (MVN network streaming protocol, rev. N)."""
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
"""Index of each segment's parent, -1 for the pelvis."""
BONES = np.array([(parent, child) for child, parent in enumerate(PARENTS) if parent >= 0])
"""Each bone as the pair of segments whose origins it connects, parent first (22 x 2); it is rigid, and rotates with its
parent.
"""


class SegmentFrame(NamedTuple):
    """All segments of one person at one moment.

    The origin of a segment is the centre of the joint towards the pelvis. In the T-pose all have the same
    orientation: x forward, y left, z up.

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


class JointAngles(NamedTuple):
    """Angles of a person's joints (type 20).

    Attributes:
        person: Number of the person, from 0.
        sample: Counter of the frame.
        parents: Name of the segment on the pelvis' side of each joint.
        children: Name of the one on the other side.
        angles_rad: Angles about x, y and z of each joint (n x 3) [rad].
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
        sample: Counter of the frame.
        kind: The type. 21: position, velocity, acceleration [m, m/s, m/s2]; 22: quaternion w, x, y, z, angular
            velocity, angular acceleration [deg/s, deg/s2]; 23: quaternion w, x, y, z, acceleration, magnetic field.
        ids: Ids of segments, from 1, or of trackers.
        values: Values of each of them, in that order.
    """

    person: int
    sample: int
    kind: int
    ids: tuple[int, ...]
    values: Array


class PersonInfo(NamedTuple):
    """Fields of a person, by key, such as `name` and `color` (type 12)."""

    person: int
    fields: dict[str, str]


class TPose(NamedTuple):
    """Origins of a person's segments in the T-pose [m], by segment (type 13)."""

    person: int
    origins: dict[str, tuple[float, float, float]]


class TimeCode(NamedTuple):
    """Time of day of a sample, as HH:MM:SS.mmm (type 25)."""

    person: int
    sample: int
    time: str


Message = SegmentFrame | JointAngles | CenterOfMass | SegmentMotion | PersonInfo | TPose | TimeCode
