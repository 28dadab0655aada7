"""Inputs of the guard's node other than targets: measured positions and forces, and bodies around the robot."""

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from urllib.parse import unquote

import rospy
import tf2_ros
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.tf_interface import TfListener
from robot_model.collision.shapes import Obstacle, ObstacleKind
from robot_model.geometry import Pose
from safe_robot.check import CheckContext

QUEUE_SIZE = 100
NEVER_S = float("-inf")
NEVER = 0.0, NEVER_S
MARKERS = "rpbi/markers"
MARKERS_HZ = 50.0
"""Rate at which the poses of bodies are read [Hz]."""
LEAST_MOTION = 1e-4
"""Changes of a body's position [m] and of its quaternion's components are ignored up to this value."""
KIND_OF_MARKER: dict[int, ObstacleKind] = {
    Marker.CUBE: "box",
    Marker.SPHERE: "sphere",
    Marker.CYLINDER: "cylinder",
    Marker.MESH_RESOURCE: "mesh",
    Marker.TRIANGLE_LIST: "points",
}


class Measurements:
    """Receives and stores the newest joint states, wrenches and bodies of the environment.

    A joint state may contain only some of the guarded joints, for instance those of one arm. The newest position
    of each joint is stored, and the age of the measurement is the largest age of these positions. A joint state without
    any guarded joint, or with non-finite values, is refused with a warning. Wrenches [N, N m] are kept in the frame of
    the sensor. A missing value has an infinite age.

    Args:
        joint_names: Names of the n guarded joints.
        base_frame: TF frame of the robot's root link; None if bodies are not needed.
        left_out: Names of bodies that are not obstacles.
        bodies_timeout_s: Largest age of the poses of bodies [s].
    """

    def __init__(
        self, joint_names: Sequence[str], base_frame: str | None, left_out: Sequence[str], bodies_timeout_s: float
    ) -> None:
        self._joint_names = tuple(joint_names)
        self._live_obstacles = None if base_frame is None else LiveObstacles(base_frame, left_out, bodies_timeout_s)
        self._measured: Mapping[str, tuple[float, float]] = {}
        """Position [rad or m] and time [s] by joint."""
        self._has_measured = threading.Event()
        self._wrench: tuple[tuple[float, ...], float] = (0.0,) * 6, NEVER_S
        self._warn = ThrottledWarning()
        options = {"queue_size": QUEUE_SIZE, "tcp_nodelay": True}
        rospy.Subscriber("joint_states/measured", JointState, self._on_measured, **options)
        rospy.Subscriber("robot_safety/wrench", WrenchStamped, self._on_wrench, **options)

    @property
    def obstacles(self) -> tuple[Obstacle, ...] | None:
        """Present bodies of the environment; None without a source of bodies, or while a body's pose is unknown."""
        return None if self._live_obstacles is None else self._live_obstacles.obstacles

    def wait(self, timeout_s: float) -> None:
        """Waits until the positions of all guarded joints have been measured, at most for `timeout_s` [s]."""
        self._has_measured.wait(timeout_s)

    def context(self, sent_s: float, age_s: float = 0.0, stamp_step_s: float | None = None) -> CheckContext:
        """Returns the context with which checks examine a target.

        Args:
            sent_s: Time of the monotonic clock from which `since_command_s` counts [s].
            age_s: Age of the target [s]; 0 if unknown.
            stamp_step_s: Stamp of the target minus stamp of the previous target [s]; None without a previous stamp.
        """
        now_s = time.monotonic()
        measured, (wrench, wrench_s) = self._measured, self._wrench
        measured_s = min((measured.get(name, NEVER)[1] for name in self._joint_names), default=NEVER_S)
        return CheckContext(
            now_s=now_s,
            age_s=age_s,
            stamp_step_s=stamp_step_s,
            since_command_s=now_s - sent_s,
            measured={name: position for name, (position, _) in measured.items()},
            measured_age_s=now_s - measured_s,
            wrench=wrench,
            wrench_age_s=now_s - wrench_s,
            obstacles=self.obstacles,
        )

    def _on_measured(self, message: JointState) -> None:
        try:
            values = values_in(message)
            if not set(values.names).intersection(self._joint_names):
                values.in_order(self._joint_names)
        except (InterfaceError, ValueError) as error:
            self._warn(rospy.resolve_name("joint_states/measured"), f"message refused: {error}")
            return
        now_s = time.monotonic()
        self._measured = {**self._measured, **{name: (q, now_s) for name, q in zip(values.names, values.position)}}
        if all(name in self._measured for name in self._joint_names):
            self._has_measured.set()

    def _on_wrench(self, message: WrenchStamped) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        wrench = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
        self._wrench = wrench, time.monotonic()


class LiveObstacles:
    """Tracks obstacles: the visual shapes of bodies on `rpbi/markers`, at the bodies' poses in TF.

    Args:
        base_frame: TF frame of the robot's root.
        left_out: Names of bodies that are not obstacles: the robot itself, and bodies that the robot may pass through.
        timeout_s: Largest age of a transform [s]; with an older transform, the pose of the body is unknown.

    Attributes:
        obstacles: The shapes in the frame of the robot's root link; None while bodies or poses are unknown.
    """

    def __init__(self, base_frame: str, left_out: Sequence[str], timeout_s: float) -> None:
        self.obstacles: tuple[Obstacle, ...] | None = None
        self._base_frame, self._left_out = base_frame, frozenset(left_out)
        self._markers: dict[tuple[str, int], Marker] = {}
        self._has_markers, self._timeout_s = False, timeout_s
        self._warn = ThrottledWarning()
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = TfListener(self._buffer)
        self._subscriber = rospy.Subscriber(MARKERS, MarkerArray, self._on_markers, queue_size=100)
        self._timer = WallTimer(MARKERS_HZ, self._update)

    def close(self) -> None:
        """Stops the timer, and unsubscribes."""
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
        self._markers, self._has_markers = markers, True

    def _update(self) -> None:
        if not self._has_markers:
            return
        try:
            found = tuple(self._shapes())
        except (tf2_ros.TransformException, ValueError) as error:
            self._warn(MARKERS, f"the bodies around the robot are unknown: {error}")
            self.obstacles = None
            return
        if self.obstacles is None or _differ(self.obstacles, found):
            self.obstacles = found

    def _shapes(self) -> Iterator[Obstacle]:
        for marker in self._markers.values():
            kind = KIND_OF_MARKER.get(marker.type)
            if kind is None:
                raise ValueError(
                    f"'{marker.ns}' is a marker of type {marker.type}: expected one of {[*KIND_OF_MARKER]}"
                )
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
        or any(abs(x - y) > LEAST_MOTION for x, y in zip((*a.pose[0], *a.pose[1]), (*b.pose[0], *b.pose[1])))
        for a, b in zip(before, now)
    )
