"""RViz markers of a person: a thick line for each bone, and a head."""

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from operator_node.mvn.segments import SEGMENTS, SegmentFrame
from operator_node.mvn.skeleton import BONES, inverse, rotate

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
        ways = frame.positions[children] - frame.positions[parents]
        ends = rotate(inverse(frame.quats_xyzw[parents]), ways)
        for marker in self._markers.values():
            marker.points = []
        for parent, end in zip(parents, ends):
            self._markers[SEGMENTS[parent]].points += _line(end)
        for name, tip in _TIPS.items():
            self._markers[name].points = _line(np.array(tip))
        return MarkerArray([each for name, each in self._markers.items() if each.points or name == "Head"])

    def gone(self) -> MarkerArray:
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
