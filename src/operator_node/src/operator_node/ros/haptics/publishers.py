"""Topics that the haptic node publishes from the loop's reports."""

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

from custom_ros_tools.ros.transform_messages import transform_message
from operator_node.haptics.controller import Snapshot
from operator_node.haptics.messages import LoopReport
from operator_node.haptics.node_config import HapticNodeConfig
from operator_node.msg import HapticState
from robot_model import geometry

QUEUE_SIZE = 10
_publisher = partial(rospy.Publisher, queue_size=QUEUE_SIZE, tcp_nodelay=True)


class HandlePublisher:
    """Publishes handle, force and target.

    Args:
        config: Names of the frames.
        workspace_m: Radius of the device's workspace, the unit of the axes of `joy` [m].
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
        """Publishes a report; `start` is the initial pose of the target, None until it is known."""
        header = Header(stamp=rospy.Time.now(), frame_id=self._config.base_frame_id)
        message = WrenchStamped(header=header)
        message.wrench.force = Vector3(*report.force)
        self._force.publish(message)
        snapshot = report.snapshot
        if snapshot is None or snapshot == self._sent:
            return  # no new sample of the device
        self._sent = snapshot
        reading = snapshot.reading
        self._pose.publish(PoseStamped(header, Pose(Point(*reading.position), Quaternion(*reading.quat_xyzw))))
        twist = TwistStamped(header=header)
        twist.twist.linear = Vector3(*snapshot.velocity)
        self._twist.publish(twist)
        axes = [min(max(each / self._workspace_m, -1.0), 1.0) for each in snapshot.deviation]
        self._joy.publish(Joy(header, axes, reading.buttons))
        if (
            header.stamp != self._stamp
        ):  # otherwise ROS time is paused, and TF ignores a second transform with the same stamp
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
            target.transform = transform_message(geometry.plus(position, snapshot.way), quat)
            transforms.append(target)
        self._tf.sendTransform(transforms)


class HapticStatePublisher:
    """Publishes `haptics/state`.

    Args:
        config: The constant part.
        stiffness_bound: Colgate's bound [N/m].
    """

    def __init__(self, config: HapticNodeConfig, stiffness_bound: float) -> None:
        self._config, self._stiffness_bound = config, stiffness_bound
        self._samples, self._samples_s = 0, time.monotonic()
        self._lateness_s = 0.0
        self._state = _publisher("haptics/state", HapticState)

    def note(self, report: LoopReport) -> None:
        """Records the lateness of the loop."""
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
                message=report.trouble or report.fault or ("" if is_felt else "nothing from the tool"),
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
