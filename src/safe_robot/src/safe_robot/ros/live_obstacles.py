"""Bodies around the robot, from the markers that the simulator publishes."""

from collections.abc import Iterator, Sequence
from urllib.parse import unquote

import rospy
import tf2_ros
from geometry_msgs.msg import Pose as PoseMessage
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.tf_listener import TfListener
from robot_model.geometry import Pose
from safe_robot.geometry.obstacles import Kind, Obstacle

TOPIC = "rpbi/markers"
HZ = 50.0
"""Rate at which the poses of bodies are read [Hz]."""
STILL = 1e-4
"""Smallest motion of a body [m, and parts of a quaternion]; smaller ones are ignored."""
KINDS: dict[int, Kind] = {
    Marker.CUBE: "box",
    Marker.SPHERE: "sphere",
    Marker.CYLINDER: "cylinder",
    Marker.MESH_RESOURCE: "mesh",
    Marker.TRIANGLE_LIST: "points",
}


class LiveObstacles:
    """The visual shapes of all bodies of `rpbi/markers`, except those left out, at their poses in TF.

    Args:
        base_frame: TF frame of the robot's root.
        left_out: Bodies that are no obstacles: the robot itself, and bodies that it may pass through.
        timeout_s: Largest age of a transform [s]; beyond it, the pose of the body is unknown.

    Attributes:
        obstacles: The shapes in the robot's root; None while bodies or poses are unknown.
    """

    def __init__(self, base_frame: str, left_out: Sequence[str], timeout_s: float) -> None:
        self.obstacles: tuple[Obstacle, ...] | None = None
        self._base_frame, self._left_out = base_frame, frozenset(left_out)
        self._markers: dict[tuple[str, int], Marker] = {}
        self._is_told, self._timeout_s = False, timeout_s
        self._warn = ThrottledWarning()
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = TfListener(self._buffer)
        self._subscriber = rospy.Subscriber(TOPIC, MarkerArray, self._on_markers, queue_size=100)
        self._timer = WallTimer(HZ, self._look)

    def close(self) -> None:
        """Stops reading, and unsubscribes."""
        self._timer.stop()
        self._subscriber.unregister()
        self._listener.unregister()

    def _on_markers(self, message: MarkerArray) -> None:
        markers = dict(self._markers)
        for marker in message.markers:
            if marker.action == Marker.DELETEALL:
                markers.clear()
            elif marker.action == Marker.DELETE:
                markers.pop((marker.ns, marker.id), None)
            elif marker.ns not in self._left_out:
                markers[marker.ns, marker.id] = marker
        self._markers, self._is_told = markers, True

    def _look(self) -> None:
        if not self._is_told:
            return
        try:
            found = tuple(self._found())
        except (tf2_ros.TransformException, ValueError) as error:
            self._warn(TOPIC, f"the bodies around the robot are unknown: {error}")
            self.obstacles = None
            return
        if self.obstacles is None or _differ(self.obstacles, found):
            self.obstacles = found

    def _found(self) -> Iterator[Obstacle]:
        for marker in self._markers.values():
            kind = KINDS.get(marker.type)
            if kind is None:
                raise ValueError(f"'{marker.ns}' is a marker of type {marker.type}: expected one of {[*KINDS]}")
            pose = self._place(marker.header.frame_id) @ _pose(marker.pose)
            size = marker.scale.x, marker.scale.y, marker.scale.z
            corners = tuple((point.x, point.y, point.z) for point in marker.points)
            yield Obstacle(marker.ns, kind, size, pose, unquote(marker.mesh_resource.removeprefix("file://")), corners)

    def _place(self, frame: str) -> Pose:
        found = self._buffer.lookup_transform(self._base_frame, frame, rospy.Time(0))
        age_s = (rospy.Time.now() - found.header.stamp).to_sec()
        if found.header.stamp and age_s > self._timeout_s:
            raise ValueError(f"TF from '{self._base_frame}' to '{frame}' is {age_s:.1f} s old")
        t, r = found.transform.translation, found.transform.rotation
        return Pose((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))


def _pose(message: PoseMessage) -> Pose:
    p, q = message.position, message.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def _differ(before: Sequence[Obstacle], now: Sequence[Obstacle]) -> bool:
    return len(before) != len(now) or any(
        (a.name, a.shape) != (b.name, b.shape)
        or any(abs(x - y) > STILL for x, y in zip((*a.pose[0], *a.pose[1]), (*b.pose[0], *b.pose[1])))
        for a, b in zip(before, now)
    )
