"""Moves the joints of a robot one after the other, over its target topic."""

from __future__ import annotations

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64

from custom_ros_tools.ros.lifecycle.run_node import run_node
from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import RobotInfo, RobotInfoResponse
from rpbi_examples.swing import Swing

from .arguments import robot_name

HZ = 50.0


def main() -> None:
    """Runs the node for the robot named by `~robot_name` or the first argument."""
    run_node("basic_robot_example", _swing)


def _swing() -> None:
    name = robot_name()
    rospy.wait_for_service(f"rpbi/{name}/robot_info")
    info: RobotInfoResponse = rospy.ServiceProxy(f"rpbi/{name}/robot_info", RobotInfo)()
    joints = [joint for joint in info.joint_info if not joint.is_fixed]
    state = dict(zip(info.current_joint_state.name, info.current_joint_state.position))
    limits = [_limits(joint) for joint in joints]
    swing = Swing([state[joint.jointName] for joint in joints], *zip(*limits))
    publisher = rospy.Publisher(f"rpbi/{name}/joint_states/target", JointState, queue_size=10)
    running = _Running()
    rate = rospy.Rate(HZ)
    time_s = 0.0
    while not rospy.is_shutdown():
        if running.is_so:
            target = JointState(name=[joint.jointName for joint in joints], position=swing.at(time_s))
            target.header.stamp = rospy.Time.now()
            publisher.publish(target)
            time_s += 1.0 / HZ
        rate.sleep()


class _Running:
    """Whether the simulation runs, from its status."""

    def __init__(self) -> None:
        self.is_so = False
        rospy.Subscriber("rpbi/status", Int64, self._take, queue_size=1)

    def _take(self, status: Int64) -> None:
        self.is_so = status.data == 1


def _limits(joint: JointInfo) -> tuple[float, float]:
    """Returns lower and upper position limit; PyBullet gives an inverted range where there is none."""
    limited = joint.jointLowerLimit < joint.jointUpperLimit
    return (joint.jointLowerLimit, joint.jointUpperLimit) if limited else (float("-inf"), float("inf"))
