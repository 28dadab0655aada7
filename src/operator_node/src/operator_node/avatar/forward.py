"""Forward kinematics of a person, from base and hinges to segments."""

import numpy as np
from scipy.spatial.transform import Rotation

from operator_node.mvn.segments import SegmentFrame
from operator_node.mvn.skeleton import PARENTS

from .anthropometry import Array
from .joints import HINGES, JOINTS


def segment_frame(offsets: Array, position: Array, quat_xyzw: Array, hinges: dict[str, float]) -> SegmentFrame:
    """Returns the segments of a person for poses of pelvis and hinges.

    Args:
        offsets: Origin of each segment in its parent (23 x 3) [m].
        position: Origin of the pelvis in the world (3) [m].
        quat_xyzw: Orientation of the pelvis in the world (4).
        hinges: Positions of hinges by name [rad]; others are at 0.

    Raises:
        ValueError: If there is no such hinge.
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
