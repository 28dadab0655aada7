"""Joints between the segments of a person: names, orders of axes, ranges of motion, and forward kinematics."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from operator_node.mvn.segments import PARENTS, SEGMENTS, SegmentFrame

from .anthropometry import Array

AXES = "xyz"
Range = tuple[float, float]


class HumanJoint(NamedTuple):
    """Joint between a segment and its parent, modelled as three hinges. All hinges are at 0 in the T-pose.

    Attributes:
        name: Name of the joint, as in MVN.
        parent: Name of the parent segment, towards the pelvis.
        child: Name of the segment that the joint moves.
        order: Axes of the hinges from parent to child. For "yxz", the child's orientation in the parent is R_y R_x R_z.
        x: Lower and upper limit of the hinge about x (forward) [deg].
        y: Lower and upper limit of the hinge about y (left) [deg].
        z: Lower and upper limit of the hinge about z (up) [deg].
        effort: Largest torque of each hinge [N m].
    """

    name: str
    parent: str
    child: str
    order: str
    x: Range
    y: Range
    z: Range
    effort: float

    @property
    def hinges(self) -> tuple[str, str, str]:
        """Names of the hinges, such as `jRightElbow_rotz`, in the order from parent to child."""
        first, second, third = (f"{self.name}_rot{axis}" for axis in self.order)
        return first, second, third

    @property
    def limits(self) -> tuple[Range, Range, Range]:
        """Lower and upper limit of each hinge [rad], in the order from parent to child."""
        first, second, third = ((math.radians(low), math.radians(high)) for low, high in map(self._range, self.order))
        return first, second, third

    def _range(self, axis: str) -> Range:
        return {"x": self.x, "y": self.y, "z": self.z}[axis]


def _right(joint: str, parent: str, child: str, order: str, x: Range, y: Range, z: Range, effort: float) -> HumanJoint:
    return HumanJoint(f"jRight{joint}", parent, f"Right{child}", order, x, y, z, effort)


_MIDDLE = (
    HumanJoint("jL5S1", "Pelvis", "L5", "yxz", (-15, 15), (-15, 35), (-20, 20), 300),
    HumanJoint("jL4L3", "L5", "L3", "yxz", (-15, 15), (-15, 35), (-20, 20), 300),
    HumanJoint("jL1T12", "L3", "T12", "yxz", (-15, 15), (-15, 35), (-20, 20), 300),
    HumanJoint("jT9T8", "T12", "T8", "yxz", (-15, 15), (-15, 35), (-20, 20), 300),
    HumanJoint("jT1C7", "T8", "Neck", "yxz", (-35, 35), (-35, 35), (-45, 45), 50),
    HumanJoint("jC1Head", "Neck", "Head", "yxz", (-35, 35), (-35, 35), (-45, 45), 50),
)
_RIGHT = (
    _right("C7Shoulder", "T8", "Shoulder", "xyz", (-45, 15), (-30, 30), (-30, 40), 150),
    _right("Shoulder", "RightShoulder", "UpperArm", "xyz", (-100, 130), (-120, 100), (-60, 135), 120),
    _right("Elbow", "RightUpperArm", "ForeArm", "zxy", (-20, 20), (-100, 100), (-10, 150), 80),
    _right("Wrist", "RightForeArm", "Hand", "xzy", (-80, 90), (-25, 25), (-40, 30), 20),
    _right("Hip", "Pelvis", "UpperLeg", "yxz", (-50, 40), (-130, 35), (-50, 50), 250),
    _right("Knee", "RightUpperLeg", "LowerLeg", "yxz", (-15, 15), (-10, 140), (-30, 30), 250),
    _right("Ankle", "RightLowerLeg", "Foot", "yxz", (-35, 35), (-30, 60), (-35, 35), 180),
    _right("BallFoot", "RightFoot", "Toe", "yxz", (-15, 15), (-70, 40), (-15, 15), 40),
)


def _mirrored(joint: HumanJoint) -> HumanJoint:
    """Returns the left joint for a right joint. The limits of rotations about x and z are mirrored."""
    return joint._replace(
        name=joint.name.replace("Right", "Left"),
        parent=joint.parent.replace("Right", "Left"),
        child=joint.child.replace("Right", "Left"),
        x=(-joint.x[1], -joint.x[0]),
        z=(-joint.z[1], -joint.z[0]),
    )


_BY_CHILD = {joint.child: joint for joint in (*_MIDDLE, *_RIGHT, *map(_mirrored, _RIGHT))}
JOINTS: tuple[HumanJoint, ...] = tuple(_BY_CHILD[name] for name in SEGMENTS[1:])
"""The joints of all segments except the pelvis, in the order of `SEGMENTS`.

The ranges are those of the American Academy of Orthopaedic Surgeons (Joint Motion: Method of Measuring and Recording,
1965), enlarged by some 10 deg for errors of suits. The ranges of trunk and neck are divided evenly among their joints,
and enlarged by half because people bend unevenly. The ranges of the shoulders are wider because their three angles
depend on each other. Axes that are not in the tables have small ranges. Efforts have the magnitude of a strong adult's.
"""
HINGES: tuple[str, ...] = tuple(hinge for joint in JOINTS for hinge in joint.hinges)
"""The 66 hinges: three for each joint, in the order of `JOINTS`."""
LOWER, UPPER = np.array([limits for joint in JOINTS for limits in joint.limits]).T
"""Limits of the hinges (66) [rad]."""


def segment_frame(offsets: Array, position: Array, quat_xyzw: Array, hinges: dict[str, float]) -> SegmentFrame:
    """Returns the segment poses of a person, computed by forward kinematics.

    Args:
        offsets: Origin of each segment in its parent's frame (23 x 3) [m].
        position: Origin of the pelvis in the world (3) [m].
        quat_xyzw: Orientation of the pelvis in the world (4), x, y, z, w.
        hinges: Angles of hinges, keyed by name [rad]. Missing hinges are at 0.

    Raises:
        ValueError: If the name of a hinge is unknown.
    """
    if unknown := sorted(set(hinges) - set(HINGES)):
        raise ValueError(f"unknown hinge '{unknown[0]}', expected names such as '{HINGES[0]}'")
    rotations, positions = [Rotation.from_quat(quat_xyzw)], [np.asarray(position, dtype=float)]
    for index, joint in enumerate(JOINTS, start=1):
        parent = PARENTS[index]
        angles = [hinges.get(hinge, 0.0) for hinge in joint.hinges]
        rotations.append(rotations[parent] * Rotation.from_euler(joint.order.upper(), angles))
        positions.append(positions[parent] + rotations[parent].apply(offsets[index]))
    return SegmentFrame(0, 0, 0, np.array(positions), np.array([each.as_quat() for each in rotations]))
