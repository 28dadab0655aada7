"""Records one episode of some simulated seconds, in which an arm follows targets."""

from __future__ import annotations

import argparse
import sys
import time

import rospy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

TARGETS_HZ = 20.0
"""Targets a second, in wall time."""
JOINTS = ("lwr_arm_0_joint", "lwr_arm_1_joint")


def main() -> None:
    """Records."""
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", type=float, help="length of the episode in simulated time")
    seconds = parser.parse_args().seconds
    rospy.init_node("record_hours")
    target = rospy.Publisher("rpbi/kuka_lwr/joint_states/target", JointState, queue_size=10)
    rospy.wait_for_service("record/start")
    _call("start")
    begin_s, turn = rospy.get_time(), 0
    while rospy.get_time() < begin_s + seconds:
        turn += 1
        target.publish(JointState(name=JOINTS, position=[0.4 * (turn % 3 - 1), 0.3 + 0.1 * (turn % 5)]))
        time.sleep(1.0 / TARGETS_HZ)
    _call("stop")


def _call(name: str) -> None:
    answer = rospy.ServiceProxy(f"record/{name}", Trigger)()
    if not answer.success:
        sys.exit(f"{name}: {answer.message}")


if __name__ == "__main__":
    main()
