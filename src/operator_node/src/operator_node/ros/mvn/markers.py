"""A person as RViz draws them: a thick line for each segment."""

import numpy as np
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from operator_node.mvn.segments import SegmentFrame
from operator_node.mvn.skeleton import BONES, INDEX, rotate

LINE_M, HEAD_M = 0.035, 0.20
COLOURS = ((0.16, 0.42, 0.72), (0.85, 0.45, 0.12), (0.20, 0.60, 0.35), (0.60, 0.30, 0.65))
"""Of the people, in turns."""
_ENDS = {
    "RightHand": (0.0, -0.16, 0.0),
    "LeftHand": (0.0, 0.16, 0.0),
    "RightToe": (0.07, 0, 0),
    "LeftToe": (0.07, 0, 0),
}
"""Where segments end that nothing hangs on, as they see it [m]."""
_TIPS = np.array([INDEX[name] for name in _ENDS])
_OFFSETS = np.array(list(_ENDS.values()))


class PersonMarkers:
    """The markers of one person.

    Args:
        number: Number of the person.
        parent: TF frame that the person is in.
    """

    def __init__(self, number: int, parent: str) -> None:
        self._lines, self._head = Marker(type=Marker.LINE_LIST), Marker(type=Marker.SPHERE)
        self._lines.scale.x = LINE_M
        self._head.scale.x = self._head.scale.y = HEAD_M
        self._head.scale.z = 1.2 * HEAD_M
        for marker_id, marker in enumerate((self._lines, self._head)):
            marker.ns, marker.id = f"person {number}", marker_id
            marker.header.frame_id = parent
            marker.pose.orientation.w = 1.0
            marker.color = ColorRGBA(*COLOURS[number % len(COLOURS)], 1.0)

    def message(self, frame: SegmentFrame, stamp: rospy.Time) -> MarkerArray:
        """Returns what draws a frame."""
        tips = frame.positions[_TIPS] + rotate(frame.quats_xyzw[_TIPS], _OFFSETS)
        ends = np.concatenate((frame.positions[BONES], np.stack((frame.positions[_TIPS], tips), axis=1)))
        self._lines.points = [Point(*end) for end in ends.reshape(-1, 3).tolist()]
        head = frame.positions[INDEX["Head"]] + rotate(frame.quats_xyzw[[INDEX["Head"]]], np.array([[0, 0, 0.09]]))[0]
        self._head.pose.position = Point(*head.tolist())
        x, y, z, w = frame.quats_xyzw[INDEX["Head"]].tolist()
        self._head.pose.orientation.x, self._head.pose.orientation.y = x, y
        self._head.pose.orientation.z, self._head.pose.orientation.w = z, w
        for marker in (self._lines, self._head):
            marker.header.stamp = stamp
            marker.action = Marker.ADD
        return MarkerArray([self._lines, self._head])

    def gone(self) -> MarkerArray:
        """Returns what takes the person away."""
        return MarkerArray(
            [
                Marker(header=each.header, ns=each.ns, id=each.id, action=Marker.DELETE)
                for each in (self._lines, self._head)
            ]
        )
