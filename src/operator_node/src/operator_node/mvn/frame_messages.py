"""Messages of frames: TF, poses and RViz markers of the segments of a person."""

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
"""Range of the length of a quaternion; others are rejected."""
LINE_M, HEAD_M = 0.035, 0.20
COLOURS = ((0.16, 0.42, 0.72), (0.85, 0.45, 0.12), (0.20, 0.60, 0.35), (0.60, 0.30, 0.65))
"""Colours of the people, in turn."""
_TIPS = {
    "RightHand": (0.0, -0.16, 0.0),
    "LeftHand": (0.0, 0.16, 0.0),
    "RightToe": (0.07, 0, 0),
    "LeftToe": (0.07, 0, 0),
}
"""Tip of segments without children, in their frames [m]."""
_HEAD_M = 0.09
"""Height of the middle of the head above its joint [m]."""


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


class PersonMarkers:
    """The markers of one person, each locked to the TF frame of its segment, so that they move with it.

    Args:
        number: Number of the person.
        prefix: Prefix of the TF frames of the segments.
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
        """Returns the markers of the bones of a frame; bones are rigid, so that markers are sent rarely."""
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
        """Returns a message that removes the person."""
        return MarkerArray(
            [
                Marker(header=each.header, ns=each.ns, id=each.id, action=Marker.DELETE)
                for each in self._markers.values()
            ]
        )


def _line(end: np.ndarray) -> list[Point]:
    """Returns a line from the origin."""
    return [Point(), Point(*end.tolist())]
