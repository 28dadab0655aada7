"""What a motion-capture suit's node says of somebody with the size of our avatar."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.joints import segment_frame

HEIGHT_M = 1.75


def message(hinges: dict[str, float], position=(0.0, 0.0, 0.93)) -> PoseArray:
    """Returns the segments of somebody who stands, but for some joints [rad]."""
    frame = segment_frame(segment_offsets(HEIGHT_M), np.array(position), np.array((0.0, 0.0, 0.0, 1.0)), hinges)
    poses = [Pose(Point(*p), Quaternion(*q)) for p, q in zip(frame.positions.tolist(), frame.quats_xyzw.tolist())]
    return PoseArray(poses=poses)
