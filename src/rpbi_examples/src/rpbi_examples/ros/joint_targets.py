"""Targets of a robot's joints, by its topics and services."""

import threading
from collections.abc import Sequence

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64

from custom_ros_tools.ros.services import get_srv_handler
from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import RobotInfo, RobotInfoResponse

HZ = 50.0
"""Rate of the targets."""


def wait_until_ready() -> None:
    """Waits for a message on the topic that `~ready` names, if it is given.

    With a real robot, these are the commands of its driver. The guard accepts a first target only at the robot's
    position. The simulated arm must not move before the guard runs.
    """
    topic = str(rospy.get_param("~ready", ""))
    if topic:
        rospy.loginfo("waiting for %s, the commands of the real robot", topic)
        rospy.wait_for_message(topic, rospy.AnyMsg)


class JointTargets:
    """Sends targets to all movable joints of a robot while the world runs; see also `wait_until_ready`.

    Targets of several robots go out together on `joint_states/target`, where names of joints begin with `NAME_`.

    Attributes:
        names: Names of the n joints in the targets.
        positions: Positions of the joints at the start, n [rad or m].
        limits: Lower and upper limit of each, infinite where there is none.
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
        """Sends positions [rad or m] with a later stamp than before, and returns when the next ones are due.

        Raises:
            rospy.ROSInterruptException: If ROS shuts down meanwhile.
        """
        while not self._running.is_set() or rospy.Time.now() <= self._stamp:
            self._sleep()
        self._stamp = rospy.Time.now()
        target = JointState(name=self.names, position=positions)
        target.header.stamp = self._stamp
        self._publisher.publish(target)
        self._sleep()

    def _sleep(self) -> None:
        """Waits for the next period; unlike rospy's sleep, it also ends when ROS shuts down in wall time."""
        self._rate.sleep()
        if rospy.is_shutdown():
            raise rospy.ROSInterruptException("ROS shuts down")

    def _on_status(self, status: Int64) -> None:
        if status.data == 1:
            self._running.set()
        else:
            self._running.clear()


def _limits(joint: JointInfo) -> tuple[float, float]:
    """Returns lower and upper position limit; PyBullet returns an inverted range if there is none."""
    limited = joint.jointLowerLimit < joint.jointUpperLimit
    return (joint.jointLowerLimit, joint.jointUpperLimit) if limited else (float("-inf"), float("inf"))
