"""Conversion of messages to segments of a person."""

import numpy as np
from geometry_msgs.msg import PoseArray

from operator_node.mvn.segments import SEGMENTS, SegmentFrame

NORMS = (0.9, 1.1)
"""Range of the length of a quaternion; others are rejected."""


def frame_in(message: PoseArray) -> SegmentFrame:
    """Returns the segments in a message.

    Raises:
        ValueError: If there are not 23, a number is not finite or a quaternion has not length 1.
    """
    if len(message.poses) != len(SEGMENTS):
        raise ValueError(f"expected {len(SEGMENTS)} poses, got {len(message.poses)}")
    rows = np.array(
        [
            [*(getattr(pose.position, axis) for axis in "xyz"), *(getattr(pose.orientation, axis) for axis in "xyzw")]
            for pose in message.poses
        ]
    )
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        raise ValueError(f"{SEGMENTS[int(np.argmin(finite))]}: a number is not finite")
    norms = np.linalg.norm(rows[:, 3:], axis=1)
    wrong = (norms < NORMS[0]) | (norms > NORMS[1])
    if wrong.any():
        index = int(np.argmax(wrong))
        raise ValueError(f"{SEGMENTS[index]}: expected a quaternion of length 1, got {norms[index]:g}")
    return SegmentFrame(0, message.header.seq, 0, rows[:, :3], rows[:, 3:] / norms[:, None])
