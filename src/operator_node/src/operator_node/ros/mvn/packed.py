"""Messages of frames that are serialised at once: the same bytes as from their types, in a fraction of the time."""

import struct
from io import BytesIO

import numpy as np
import rospy
from geometry_msgs.msg import PoseArray
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from operator_node.mvn.segments import SEGMENTS, SegmentFrame

_COUNT = struct.Struct("<I")


class SerializedTransforms(TFMessage):
    """A serialised message for /tf; its `transforms` stay empty."""

    packed: bytes

    def serialize(self, buff: BytesIO) -> None:
        """Writes it to a buffer."""
        buff.write(self.packed)


class SerializedPoses(PoseArray):
    """Serialised poses, with an ordinary header; its `poses` stay empty."""

    packed: bytes

    def serialize(self, buff: BytesIO) -> None:
        """Writes it to a buffer."""
        header = self.header
        buff.write(struct.pack("<3I", header.seq, header.stamp.secs, header.stamp.nsecs) + _text(header.frame_id))
        buff.write(self.packed)


class FramePacker:
    """Creates the messages of one person.

    Args:
        prefix: Prefix of the TF frames of the segments.
        parent: Their parent TF frame.
    """

    def __init__(self, prefix: str, parent: str) -> None:
        self._parent = parent
        self._texts = [_text(parent) + _text(f"{prefix}/{segment}") for segment in SEGMENTS]
        self._pack = struct.Struct("<I" + "".join(f"3I{len(text)}s7d" for text in self._texts)).pack

    def messages(self, frame: SegmentFrame, stamp: rospy.Time) -> tuple[TFMessage, PoseArray]:
        """Returns the transforms and the poses of a frame."""
        rows = np.concatenate((frame.positions, frame.quats_xyzw), axis=1)
        numbers: list[object] = []
        for text, row in zip(self._texts, rows.tolist()):
            numbers += (0, stamp.secs, stamp.nsecs, text, *row)
        transforms = SerializedTransforms()
        transforms.packed = self._pack(len(SEGMENTS), *numbers)
        poses = SerializedPoses(header=Header(stamp=stamp, frame_id=self._parent))
        poses.packed = _COUNT.pack(len(SEGMENTS)) + rows.astype("<f8").tobytes()
        return transforms, poses


def _text(text: str) -> bytes:
    data = text.encode()
    return _COUNT.pack(len(data)) + data
