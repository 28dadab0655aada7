"""`ik_setup_node.py pybullet` with `~config`: problems for the inverse kinematics of a simulated robot."""

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from ik_ros.node_configs import RobotIKConfig, TargetParameters
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import RobotInfo

from .solver_nodes import publish_problems
from .tf import FreshTf

TOPICS = "ik/setup/pybullet"
NOT_IN_MESSAGES = {"robot_name", "parent_frame_id", "child_frame_id"}
"""Keys of `~config` that are no fields of a problem."""


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
        rospy.set_param("ik_ros/interface", "pybullet")
        self._joints = _joints_of(config.robot_name)
        rospy.Subscriber(f"{TOPICS}/currentPosition", JointState, self._take_current, queue_size=1)
        publish_problems(TOPICS, CalculateInverseKinematicsProblem, timing.hz, start_on_init, self._problem)

    def _take_current(self, message: JointState) -> None:
        try:
            values = JointValues.of(message.name, message.position).in_order(self._joints)
        except (InterfaceError, ValueError) as error:
            self._warn(rospy.resolve_name(f"{TOPICS}/currentPosition"), f"message refused: {error}")
            return
        self._current = list(values.position)

    def _problem(self) -> CalculateInverseKinematicsProblem:
        pose = self._tf.pose()
        return CalculateInverseKinematicsProblem(
            header=Header(stamp=rospy.Time.now(), frame_id=self._config.parent_frame_id),
            targetPosition=pose.position,
            targetOrientation=pose.quat_xyzw,
            currentPosition=self._current,
            dt=self._period_s if self._current else 0.0,
            **self._config.model_dump(exclude=NOT_IN_MESSAGES),
        )


def _joints_of(robot: str) -> tuple[str, ...]:
    """Waits for a robot and returns the joints that a motor can move."""
    service = rospy.ServiceProxy(f"rpbi/{robot}/robot_info", RobotInfo)
    rospy.loginfo("waiting for %s", service.resolved_name)
    service.wait_for_service()
    return tuple(joint.jointName for joint in service().joint_info if joint.is_revolute or joint.jointType == 1)
