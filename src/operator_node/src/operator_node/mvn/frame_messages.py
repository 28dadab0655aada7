"""Converts frames of a person's segments to messages: TF, poses and RViz markers."""

import struct
from io import BytesIO

import numpy as np
import rospy
from geometry_msgs.msg import Point, PoseArray
from std_msgs.msg import ColorRGBA, Header
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from .orientations import inverse, rotate
from .segments import BONES, SEGMENTS, SegmentFrame

_COUNT = struct.Struct("<I")
NORMS = (0.9, 1.1)
"""Allowed range of the norm of a quaternion."""
LINE_M, HEAD_M = 0.035, 0.20
COLOURS = ((0.16, 0.42, 0.72), (0.85, 0.45, 0.12), (0.20, 0.60, 0.35), (0.60, 0.30, 0.65))
"""Colours of the people, red, green, blue. With more people, colours repeat."""
_TIPS = {
    "RightHand": (0.0, -0.16, 0.0),
    "LeftHand": (0.0, 0.16, 0.0),
    "RightToe": (0.07, 0, 0),
    "LeftToe": (0.07, 0, 0),
}
"""Position of the tip of segments without children, in the segment's frame [m]."""
_HEAD_M = 0.09
"""Height of the middle of the head above its joint [m]."""


class SerializedTransforms(TFMessage):
    """A message for /tf whose content is serialised already. Its field `transforms` stays empty."""

    packed: bytes

    def serialize(self, buff: BytesIO) -> None:
        """Writes the serialised message to a buffer."""
        buff.write(self.packed)


class SerializedPoses(PoseArray):
    """A message whose poses are serialised already, but not the header. Its field `poses` stays empty."""

    packed: bytes

    def serialize(self, buff: BytesIO) -> None:
        """Writes the header and the serialised poses to a buffer."""
        header = self.header
        buff.write(struct.pack("<3I", header.seq, header.stamp.secs, header.stamp.nsecs) + _text(header.frame_id))
        buff.write(self.packed)


class FramePacker:
    """Creates the TF and pose messages of one person.

    Args:
        prefix: Prefix of the segments' TF frames.
        parent: Parent TF frame of all segments.
    """

    def __init__(self, prefix: str, parent: str) -> None:
        self._parent = parent
        self._texts = [_text(parent) + _text(f"{prefix}/{segment}") for segment in SEGMENTS]
        self._pack = struct.Struct("<I" + "".join(f"3I{len(text)}s7d" for text in self._texts)).pack

    def messages(self, frame: SegmentFrame, stamp: rospy.Time) -> tuple[TFMessage, PoseArray]:
        """Returns a TF message and a PoseArray with all segments of a frame."""
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


def frame_in(message: PoseArray) -> SegmentFrame:
    """Converts the poses in a message to a frame of segments.

    Raises:
        ValueError: If the number of poses is not 23, a number is not finite, or the norm of a quaternion is outside
            `NORMS`.
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


class PersonMarkers:
    """Creates the RViz markers of one person. Each marker is locked to the TF frame of its segment and moves with it.

    Args:
        number: Number of the person, from 0.
        prefix: Prefix of the segments' TF frames.
    """

    def __init__(self, number: int, prefix: str) -> None:
        self._markers = {}
        for marker_id, name in enumerate(SEGMENTS):
            marker = Marker(ns=f"person {number}", id=marker_id, type=Marker.LINE_LIST, frame_locked=True)
            marker.header.frame_id = f"{prefix}/{name}"
            marker.scale.x = LINE_M
            marker.pose.orientation.w = 1.0
            marker.color = ColorRGBA(*COLOURS[number % len(COLOURS)], 1.0)
            self._markers[name] = marker
        head = self._markers["Head"]
        head.type = Marker.SPHERE
        head.scale.x, head.scale.y, head.scale.z = HEAD_M, HEAD_M, 1.2 * HEAD_M
        head.pose.position.z = _HEAD_M

    def message(self, frame: SegmentFrame) -> MarkerArray:
        """Returns the markers for the bones in a frame. Bones are rigid, so it is enough to send markers rarely."""
        parents, children = BONES.T
        vectors = frame.positions[children] - frame.positions[parents]
        ends = rotate(inverse(frame.quats_xyzw[parents]), vectors)
        for marker in self._markers.values():
            marker.points = []
        for parent, end in zip(parents, ends):
            self._markers[SEGMENTS[parent]].points += _line(end)
        for name, tip in _TIPS.items():
            self._markers[name].points = _line(np.array(tip))
        return MarkerArray([each for name, each in self._markers.items() if each.points or name == "Head"])

    def removal(self) -> MarkerArray:
        """Returns a message that removes the person's markers from RViz."""
        return MarkerArray(
            [
                Marker(header=each.header, ns=each.ns, id=each.id, action=Marker.DELETE)
                for each in self._markers.values()
            ]
        )


def _line(end: np.ndarray) -> list[Point]:
    """Returns the two end points of a line from the origin to `end` (3) [m]."""
    return [Point(), Point(*end.tolist())]
