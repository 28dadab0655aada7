"""`interpolation_node.py`: turns waypoints into smooth targets for a TF frame or for joints."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable

import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse
from tf2_msgs.msg import TFMessage

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import kept_parameters, private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, timed_master
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.transform_messages import transform_message
from robot_model.asset_files import ROBOT_DESCRIPTION
from robot_model.model import RobotModel
from robot_model.urdf.files import write_description

from .config import InterpolationParameters, PublisherConfig, WaypointError, WaypointMotionConfig
from .interpolator import Interpolator, TargetSample
from .limits import UNITS, MotionLimitsConfig
from .waypoints import Waypoints, read_waypoints, waypoint_matrix

NAME = "ros_Traj_interface"
WAYPOINTS = "ros_pybullet_interface/waypt_traj"
STREAMING = "/stream_interpolated_motion_flag"
"""Name of the parameter that pauses the motion while its value is not true."""
LOOKS_HZ = 5.0
"""Rate at which the parameter `STREAMING` is checked [Hz of wall time]."""
MORE = 1.5
"""Factor by which a peak without a limit has to exceed the last reported peak to be reported again."""
QUEUE_SIZE = 100
NS_PER_S = 1_000_000_000


class InterpolationNode:
    """Receives waypoints, plans a motion through the waypoints, and publishes samples of the motion in ROS time.

    Raises:
        ConfigError: If a parameter or the YAML file of the motion is invalid.
    """

    def __init__(self) -> None:
        parameters = private_parameters(InterpolationParameters)
        config = WaypointMotionConfig.parse(load_config(parameters.traj_config), parameters.traj_config)
        self._config, self._hz = config, parameters.consuming_freq
        self._limits = _limits_of(config)
        self._interpolator = Interpolator(config, self._limits)
        self._unlimited: dict[str, float] = {}
        """Last reported peaks without a limit, keyed by the name of the missing limit."""
        self._arrived: deque[tuple[rospy.Time, Waypoints] | None] = deque()
        """Waypoints for the next tick, with their arrival times. An entry None ends the motion."""
        self._last: Float64MultiArray | None = None
        self._epoch: rospy.Time | None = None
        """ROS time of the interpolator's time 0. Small times keep the precision of floats."""
        self._now_s = 0.0
        self._moves, self._is_streaming = False, True
        self._warn = ThrottledWarning()
        publisher, joints = config.communication.publisher, config.motion_dimensions.joint_names
        self._publish = (
            _frame_publisher(publisher, parameters.namespace) if joints is None else _joint_publisher(config)
        )
        kept_parameters.set(STREAMING, True)
        WallTimer(LOOKS_HZ, self._look_at_flag)
        rospy.Service("interpolation/reset", Trigger, self._reset)
        self._topic = rospy.Subscriber(
            WAYPOINTS, Float64MultiArray, self._on_waypoints, queue_size=QUEUE_SIZE, tcp_nodelay=True
        ).resolved_name
        rospy.loginfo("waits for waypoints on '%s'", self._topic)

    def run(self) -> None:
        """Publishes samples until ROS shuts down."""
        rate = rospy.Rate(self._hz, reset=True)
        try:
            while not rospy.is_shutdown():
                self._tick(rospy.Time.now())
                rate.sleep()
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():  # during a shutdown, the topic is closed already
                raise

    def _on_waypoints(self, message: Float64MultiArray) -> None:
        is_repetition = message == self._last and not self._config.interpolation.accept_repetitions
        if is_repetition:
            return
        layout = message.layout
        try:
            shape = [(each.label, each.size) for each in layout.dim]
            matrix = waypoint_matrix(shape, message.data, layout.data_offset)
            waypoints = read_waypoints(matrix, self._config.motion_dimensions)
        except WaypointError as error:
            self._warn(self._topic, f"waypoints rejected: {error}")
            return
        self._last = message
        self._arrived.append((rospy.Time.now(), waypoints))

    def _tick(self, now: rospy.Time) -> None:
        if not now:  # no clock yet
            return
        if self._epoch is None:
            self._epoch = now
        now_s = (now - self._epoch).to_sec()
        if now_s < self._now_s:
            self._warn(rospy.get_name(), f"ROS time went back by {self._now_s - now_s:g} s: the motion ends")
            self._forget()
        self._now_s = now_s
        if self._is_streaming:
            self._interpolator.resume(now_s)
        else:
            self._interpolator.pause(now_s)
        while self._arrived:
            self._add(self._arrived.popleft(), now)
        sample = self._interpolator.newest(now_s)
        if sample is not None:
            self._publish(self._epoch + rospy.Duration(0, round(sample.time_s * NS_PER_S)), sample)
        self._report()

    def _add(self, arrived: tuple[rospy.Time, Waypoints] | None, now: rospy.Time) -> None:
        assert self._epoch is not None
        if arrived is None:
            self._forget()
            return
        stamp, waypoints = arrived
        if not stamp or not self._moves:  # from rest, the first sample is the first waypoint
            stamp = now
        if self._config.interpolation.time_origin == "ros_time":
            zero_s = -self._epoch.to_sec()
        else:
            zero_s = (stamp - self._epoch).to_sec()
        try:
            added = self._interpolator.add(
                waypoints._replace(times_s=tuple(zero_s + t for t in waypoints.times_s)), self._now_s
            )
        except WaypointError as error:
            self._last = None
            self._warn(self._topic, f"waypoints rejected: {error}")
            return
        if added.stretch > 1.0:
            text = f"the motion takes {added.stretch:.3g} times as long, to keep interpolation.limits"
            self._warn(f"{self._topic} (limits)", f"{text}: as sent it has {added.excess.text}")
        if self._config.interpolation.use_interpolation:
            self._warn_of_no_limits(added.peaks.without_limit(self._limits))

    def _warn_of_no_limits(self, peaks: dict[str, float]) -> None:
        """Logs the peaks of quantities without a limit, unless similar or higher peaks were logged before."""
        if all(peak <= MORE * self._unlimited.get(key, 0.0) for key, peak in peaks.items()):
            return
        self._unlimited |= peaks
        text = ", ".join(f"{key} {peak:.3g} {UNITS[key]}" for key, peak in peaks.items())
        rospy.logwarn("interpolation.limits: there is no limit for %s, the peaks of this motion", text)

    def _forget(self) -> None:
        self._last = None
        self._interpolator.forget()

    def _report(self) -> None:
        """Logs when a motion starts from rest and when a motion ends."""
        plan = self._interpolator.plan
        moves = plan is not None and self._now_s < plan.scalars.end_s + self._interpolator.delay_s
        if moves != self._moves:
            self._moves = moves
            rospy.loginfo("the motion %s", "begins" if moves else "has ended")

    def _reset(self, _: TriggerRequest) -> TriggerResponse:
        """Service callback that ends the motion. The next motion begins at its first waypoint without a transition."""
        self._arrived.append(None)
        return TriggerResponse(True, "the motion ends; the next one begins at its first waypoint")

    def _look_at_flag(self) -> None:
        with contextlib.suppress(*MASTER_FAILURES), timed_master() as master:
            code, _, value = master.getParam(rospy.get_name(), STREAMING)
            if code == 1:
                self._is_streaming = value is True


def _limits_of(config: WaypointMotionConfig) -> MotionLimitsConfig:
    """Returns the limits of a motion.

    If the velocity limits of joints are missing, takes them from the ROS parameter `robot_description` if possible.
    """
    limits, joints = config.interpolation.limits, config.motion_dimensions.joint_names
    parameter = rospy.resolve_name(ROBOT_DESCRIPTION)
    if joints is None or limits.velocity is not None or not rospy.has_param(parameter):
        return limits
    try:
        robot = RobotModel(write_description(str(rospy.get_param(parameter))), joints)
    except InterfaceError as error:
        rospy.logwarn("%s: expected a robot with the joints of the motion: %s", parameter, error)
        return limits
    return limits.model_copy(update={"velocity": tuple(each.max_velocity for each in robot.joints)})


def _frame_publisher(config: PublisherConfig, namespace: str) -> Callable[[rospy.Time, TargetSample], None]:
    """Returns a function that publishes a sample's pose on /tf with a given stamp."""
    child = "/".join(part for part in (namespace.strip("/"), config.msg_child_frame_id) if part)
    publisher = rospy.Publisher("/tf", TFMessage, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def publish(stamp: rospy.Time, sample: TargetSample) -> None:
        assert sample.pose is not None
        header = Header(stamp=stamp, frame_id=config.header_frame_id)
        publisher.publish(TFMessage([TransformStamped(header, child, transform_message(*sample.pose))]))

    return publish


def _joint_publisher(config: WaypointMotionConfig) -> Callable[[rospy.Time, TargetSample], None]:
    """Returns a function that publishes a sample's joint positions and velocities with a given stamp."""
    topic, names = config.communication.publisher.joint_topic, config.motion_dimensions.joint_names
    publisher = rospy.Publisher(topic, JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def publish(stamp: rospy.Time, sample: TargetSample) -> None:
        state = sample.state
        publisher.publish(JointState(Header(stamp=stamp), names, state.position, state.velocity, ()))

    return publish


def main() -> None:
    """Runs the node."""
    run_node(NAME, InterpolationNode, InterpolationNode.run, anonymous=True)
