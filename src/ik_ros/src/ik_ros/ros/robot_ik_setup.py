"""`ik_setup_node.py pybullet` with `~config`: problems for the inverse kinematics of a simulated robot."""

import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.toggle import Toggle
from ik_ros.node_configs import RobotIKConfig, TargetParameters
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import RobotInfo

from .tf import FreshTf

TOPICS = "ik/setup/pybullet"
LISTS = ("lowerLimits", "upperLimits", "jointRanges", "resetPoses", "jointDamping")
QUEUE_SIZE = 10


class RobotIKSetup:
    """Publishes problems as the topic `rpbi/NAME/ik` takes them; no solver node is needed.

    It waits for the robot before it begins, to learn the order of its joints.

    Raises:
        ConfigError: If `~config` or a parameter is wrong.
        rospy.ROSInterruptException: If ROS shuts down while it waits.
    """

    def __init__(self) -> None:
        self._config = config = private_config(RobotIKConfig)
        timing = private_parameters(TargetParameters)
        start_on_init = private_parameters(StartParameters).start_on_init
        self._tf = FreshTf(config.parent_frame_id, config.child_frame_id, timing.tf_timeout_s)
        self._period_s = 1.0 / timing.hz
        self._warn = ThrottledWarning()
        self._current: list[float] = []
        self._is_on = False
        rospy.set_param("ik_ros/interface", "pybullet")
        self._joints = _joints_of(config.robot_name)
        self._publisher = rospy.Publisher(
            "ik", CalculateInverseKinematicsProblem, queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        rospy.Subscriber(f"{TOPICS}/currentPosition", JointState, self._take_current, queue_size=1)
        setup = Toggle("setup", lambda: self._switch(True), lambda: self._switch(False))
        if start_on_init:
            setup.on()
        ToggleService(f"{TOPICS}/toggle", setup.on, setup.off)
        WallTimer(timing.hz, self._publish)

    def _switch(self, on: bool) -> None:
        self._is_on = on

    def _take_current(self, message: JointState) -> None:
        try:
            values = JointValues.of(message.name, message.position).in_order(self._joints)
        except (InterfaceError, ValueError) as error:
            self._warn(rospy.resolve_name(f"{TOPICS}/currentPosition"), f"message refused: {error}")
            return
        self._current = list(values.position)

    def _publish(self) -> None:
        if not self._is_on:
            return
        try:
            pose = self._tf.pose()
        except InterfaceError as error:
            self._warn("no problem is published", str(error))
            return
        config = self._config
        message = CalculateInverseKinematicsProblem(
            link_name=config.link_name,
            targetPosition=pose.position,
            targetOrientation=pose.quat_xyzw,
            solver=config.solver,
            currentPosition=self._current,
            maxNumIterations=config.maxNumIterations,
            residualThreshold=config.residualThreshold,
            dt=self._period_s if self._current else 0.0,
            **{key: getattr(config, key) for key in LISTS},
        )
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = config.parent_frame_id
        self._publisher.publish(message)


def _joints_of(robot: str) -> tuple[str, ...]:
    """Waits for a robot and returns the joints that a motor can move."""
    service = rospy.ServiceProxy(f"rpbi/{robot}/robot_info", RobotInfo)
    rospy.loginfo("waiting for %s", service.resolved_name)
    service.wait_for_service()
    return tuple(joint.jointName for joint in service().joint_info if joint.is_revolute or joint.jointType == 1)
