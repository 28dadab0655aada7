"""Topics and TF frames of the haptic node: publishes handle, force, target and state, and receives the tool's state."""

import math
import time
from functools import partial

import rospy
import tf2_ros
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    TransformStamped,
    TwistStamped,
    Vector3,
    WrenchStamped,
)
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.tf_interface import TfListener
from custom_ros_tools.ros.transform_messages import position_in, quat_in, transform_message
from operator_node.msg import HapticState
from robot_model import geometry

from .config import HapticNodeConfig
from .controller import Snapshot
from .link import LoopReport
from .loop_client import LoopClient

QUEUE_SIZE = 10
_publisher = partial(rospy.Publisher, queue_size=QUEUE_SIZE, tcp_nodelay=True)
TOOL_HZ = 500.0
"""Rate at which TF is queried for the tool's pose [Hz]."""
LOOK_HZ = 50.0
"""Rate at which TF is queried for the orientation of the force sensor [Hz]."""
TF_CACHE_S = 2.0
NO_ROTATION: geometry.Quaternion = (0.0, 0.0, 0.0, 1.0)


class HandlePublisher:
    """Publishes the state of the handle, the force, and the TF frames of handle and target.

    Args:
        config: Parameters with the names of the frames.
        workspace_m: Radius of the device's workspace [m]. It corresponds to 1 in the axes of `joy`.
    """

    def __init__(self, config: HapticNodeConfig, workspace_m: float) -> None:
        self._config, self._workspace_m = config, workspace_m
        self._sent: Snapshot | None = None
        self._stamp: rospy.Time | None = None
        self._pose = _publisher("haptics/pose", PoseStamped)
        self._twist = _publisher("haptics/twist", TwistStamped)
        self._force = _publisher("haptics/force", WrenchStamped)
        self._joy = _publisher("joy", Joy)
        self._tf = tf2_ros.TransformBroadcaster()

    def publish(self, report: LoopReport, start: geometry.Pose | None) -> None:
        """Publishes a report of the loop. `start` is the initial pose of the target; None until it is known."""
        header = Header(stamp=rospy.Time.now(), frame_id=self._config.base_frame_id)
        message = WrenchStamped(header=header)
        message.wrench.force = Vector3(*report.force)
        self._force.publish(message)
        snapshot = report.snapshot
        if snapshot is None or snapshot == self._sent:
            return  # no new reading of the device
        self._sent = snapshot
        reading = snapshot.reading
        self._pose.publish(PoseStamped(header, Pose(Point(*reading.position), Quaternion(*reading.quat_xyzw))))
        twist = TwistStamped(header=header)
        twist.twist.linear = Vector3(*snapshot.velocity)
        self._twist.publish(twist)
        axes = [min(max(each / self._workspace_m, -1.0), 1.0) for each in snapshot.deviation]
        self._joy.publish(Joy(header, axes, reading.buttons))
        # While ROS time is paused, TF ignores further transforms with the same stamp
        if header.stamp != self._stamp:
            self._stamp = header.stamp
            self._broadcast(header, snapshot, start)

    def _broadcast(self, header: Header, snapshot: Snapshot, start: geometry.Pose | None) -> None:
        config, transforms = self._config, []
        handle = TransformStamped(header=header, child_frame_id=config.handle_frame_id)
        handle.transform = transform_message(snapshot.reading.position, snapshot.reading.quat_xyzw)
        transforms.append(handle)
        if config.target_frame_id is not None and start is not None:
            position, quat = start
            stamped = Header(stamp=header.stamp, frame_id=config.parent_frame_id)
            target = TransformStamped(header=stamped, child_frame_id=config.target_frame_id)
            target.transform = transform_message(geometry.plus(position, snapshot.displacement), quat)
            transforms.append(target)
        self._tf.sendTransform(transforms)


class HapticStatePublisher:
    """Publishes the state of the haptic device and its loop on `haptics/state`.

    Args:
        config: Parameters that each message repeats.
        stiffness_bound: Stiffness up to which a virtual wall is passive (Colgate) [N/m].
    """

    def __init__(self, config: HapticNodeConfig, stiffness_bound: float) -> None:
        self._config, self._stiffness_bound = config, stiffness_bound
        self._samples, self._samples_s = 0, time.monotonic()
        self._lateness_s = 0.0
        self._state = _publisher("haptics/state", HapticState)

    def note(self, report: LoopReport) -> None:
        """Records the lateness of the loop for the next message."""
        self._lateness_s = max(self._lateness_s, report.lateness_s)

    def publish(self, report: LoopReport) -> None:
        """Publishes the newest report, with the largest lateness recorded since the last call."""
        config, snapshot, now_s = self._config, report.snapshot, time.monotonic()
        rate_hz = max(report.samples - self._samples, 0) / (now_s - self._samples_s)
        self._samples, self._samples_s = report.samples, now_s
        lateness_s, self._lateness_s = self._lateness_s, 0.0
        is_felt = math.isfinite(report.delay_s)
        self._state.publish(
            HapticState(
                header=Header(stamp=rospy.Time.now()),
                device=config.device,
                connected=report.is_connected,
                engaged=report.is_connected and snapshot is not None and snapshot.is_engaged,
                message=report.trouble or report.fault or ("" if is_felt else "no samples of the tool"),
                stiffness=config.stiffness if config.mode == "coupling" else 0.0,
                damping=config.damping,
                stiffness_bound=self._stiffness_bound,
                delay=report.delay_s if is_felt else -1.0,
                energy=report.energy_j,
                energy_bound=report.energy_bound_j,
                interventions=report.interventions,
                sample_rate=rate_hz,
                lateness=lateness_s,
                fault_names=sorted(report.faults),
                fault_counts=[report.faults[name] for name in sorted(report.faults)],
            )
        )


class ToolFeed:
    """Forwards the tool's forces (from `haptics/wrench`) and the tool's displacements (from TF) to the loop.

    Attributes:
        start: Initial pose of the tool in the parent frame, where the target starts; None until TF has the pose.
    """

    def __init__(self, config: HapticNodeConfig, loop: LoopClient) -> None:
        self._config, self._loop = config, loop
        self._warn = ThrottledWarning()
        self.start: geometry.Pose | None = None
        self._stamp: rospy.Time | None = None
        self._frame = ""
        self._rotation: geometry.Quaternion | None = NO_ROTATION
        self._buffer = tf2_ros.Buffer(rospy.Duration.from_sec(TF_CACHE_S), debug=False)
        self._listener = TfListener(self._buffer)
        rospy.Subscriber("haptics/wrench", WrenchStamped, self._on_wrench, queue_size=1, tcp_nodelay=True)
        WallTimer(LOOK_HZ, self._look)
        if config.mode == "coupling":
            WallTimer(TOOL_HZ, self._observe_tool)

    def _on_wrench(self, message: WrenchStamped) -> None:
        """Sends the force on the tool to the haptic loop."""
        f = message.wrench.force
        if not math.isfinite(f.x + f.y + f.z):
            self._warn("haptics/wrench", f"refused, expected finite numbers, got {f.x:g}, {f.y:g}, {f.z:g}")
            return
        if message.header.frame_id != self._frame:
            self._frame, self._rotation = message.header.frame_id, None if message.header.frame_id else NO_ROTATION
            self._look_up_sensor()
        if (rotation := self._rotation) is not None:
            self._loop.observe_wrench(geometry.rotated(rotation, (f.x, f.y, f.z)), _age_s(message.header.stamp))

    def _look(self) -> None:
        if self.start is None and (found := self._tool()) is not None:
            self.start, _ = found
        self._look_up_sensor()

    def _look_up_sensor(self) -> None:
        """Looks up in TF the orientation of the frame in which the forces are given."""
        frame = self._frame.strip("/")
        if not frame:
            return
        try:
            found = self._buffer.lookup_transform(self._config.parent_frame_id, frame, rospy.Time(0))
            x, y, z, w = quat_in(found.transform).tolist()
            self._rotation = x, y, z, w
        except (tf2_ros.TransformException, ValueError) as error:
            self._warn("haptics/wrench", f"refused, since its frame '{frame}' is not known: {error}")

    def _tool(self) -> tuple[geometry.Pose, rospy.Time] | None:
        """Returns pose and stamp of the tool; None while TF does not have the pose."""
        frame = self._config.tool_frame_id
        if frame is None:
            return geometry.Pose(), rospy.Time(0)
        try:
            found = self._buffer.lookup_transform(self._config.parent_frame_id, frame, rospy.Time(0))
            x, y, z = position_in(found.transform).tolist()
            qx, qy, qz, qw = quat_in(found.transform).tolist()
            return geometry.Pose((x, y, z), (qx, qy, qz, qw)), found.header.stamp
        except tf2_ros.TransformException:
            return None
        except ValueError as error:
            self._warn(f"TF of '{frame}'", f"refused: {error}")
            return None

    def _observe_tool(self) -> None:
        """Sends the displacement of the tool from its start to the haptic loop, if TF has a new pose."""
        if self.start is None or (found := self._tool()) is None:
            return
        tool, stamp = found
        if stamp == self._stamp:
            return
        self._stamp = stamp
        self._loop.observe_tool(geometry.minus(tool.position, self.start.position), _age_s(stamp))


def _age_s(stamp: rospy.Time) -> float:
    """Returns the age of a stamp [s]; 0 for a stamp of 0."""
    return max((rospy.Time.now() - stamp).to_sec(), 0.0) if stamp else 0.0
