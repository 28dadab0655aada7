"""Publishes joint targets for the robots of the simulator."""

import threading
from collections.abc import Sequence

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64

from custom_ros_tools.ros.services import get_srv_handler
from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import RobotInfo, RobotInfoResponse

HZ = 50.0
"""Rate of the targets [Hz]."""


def wait_until_ready() -> None:
    """Waits for a message on the topic that `~ready` names. Returns at once if this parameter is empty or missing.

    With a real robot, `~ready` names the topic with the commands for the robot's driver. The simulated arm must not
    move before the first of these commands. The guard, a node that checks targets, accepts a first target only at the
    real robot's present position.
    """
    topic = str(rospy.get_param("~ready", ""))
    if topic:
        rospy.loginfo("waiting for %s, the commands of the real robot", topic)
        rospy.wait_for_message(topic, rospy.AnyMsg)


class JointTargets:
    """Publishes targets for all movable joints of one or more robots while the world runs.

    The constructor calls `wait_until_ready` and reads joints, positions and limits from the robots' services. Targets
    for one robot are published on `rpbi/NAME/joint_states/target`. Targets for several robots are published on
    `joint_states/target`, with `NAME_` in front of the joint names.

    Args:
        robot_names: Names of the robots.

    Attributes:
        names: Names of the n joints in the targets.
        positions: Initial positions of the n joints [rad or m].
        limits: Lower and upper position limit of each joint [rad or m]; infinite without a limit.
    """

    def __init__(self, *robot_names: str) -> None:
        wait_until_ready()
        self.names: list[str] = []
        self.positions: tuple[float, ...] = ()
        self.limits: list[tuple[float, float]] = []
        is_one = len(robot_names) == 1
        for robot in robot_names:
            info: RobotInfoResponse = get_srv_handler(f"rpbi/{robot}/robot_info", RobotInfo)()
            joints = [joint for joint in info.joint_info if not joint.is_fixed]
            state = dict(zip(info.current_joint_state.name, info.current_joint_state.position))
            self.names += [joint.jointName if is_one else f"{robot}_{joint.jointName}" for joint in joints]
            self.positions += tuple(state[joint.jointName] for joint in joints)
            self.limits += [_limits(joint) for joint in joints]
        topic = f"rpbi/{robot_names[0]}/joint_states/target" if is_one else "joint_states/target"
        self._publisher = rospy.Publisher(topic, JointState, queue_size=10)
        self._stamp = rospy.Time()
        self._running = threading.Event()
        rospy.Subscriber("rpbi/status", Int64, self._on_status, queue_size=1)
        self._rate = rospy.Rate(HZ)

    def send(self, positions: Sequence[float]) -> None:
        """Publishes a target, and waits until the next target is due.

        Before publishing, waits until the world runs, and until ROS time is later than the stamp of the last target.

        Args:
            positions: Target positions of the n joints [rad or m].

        Raises:
            rospy.ROSInterruptException: If ROS shuts down while the method waits.
        """
        while not self._running.is_set() or rospy.Time.now() <= self._stamp:
            self._sleep()
        self._stamp = rospy.Time.now()
        target = JointState(name=self.names, position=positions)
        target.header.stamp = self._stamp
        self._publisher.publish(target)
        self._sleep()

    def _sleep(self) -> None:
        """Waits for the next period, and raises ROSInterruptException if ROS shuts down.

        With wall time, rospy's sleep does not raise this exception.
        """
        self._rate.sleep()
        if rospy.is_shutdown():
            raise rospy.ROSInterruptException("ROS shuts down")

    def _on_status(self, status: Int64) -> None:
        if status.data == 1:
            self._running.set()
        else:
            self._running.clear()


def _limits(joint: JointInfo) -> tuple[float, float]:
    """Returns the lower and upper position limit of a joint: -inf and inf if PyBullet reports an inverted range."""
    limited = joint.jointLowerLimit < joint.jointUpperLimit
    return (joint.jointLowerLimit, joint.jointUpperLimit) if limited else (float("-inf"), float("inf"))
