"""Swings two joints of the arm, so that its links move in each frame."""

from __future__ import annotations

import math
import sys
import time

import rospy
from sensor_msgs.msg import JointState

JOINTS = ("lwr_arm_0_joint", "lwr_arm_1_joint")
AMPLITUDE_RAD, PERIOD_S, HZ = 0.3, 4.0, 50.0


def main() -> None:
    """Publishes targets on a topic until it is ended."""
    rospy.init_node("swing_arm", disable_rostime=True, disable_signals=True)
    targets = rospy.Publisher(sys.argv[1], JointState, queue_size=10)
    while not targets.get_num_connections():
        time.sleep(0.05)
    start_s = time.monotonic()
    while True:
        angle = 2.0 * math.pi * (time.monotonic() - start_s) / PERIOD_S
        positions = [AMPLITUDE_RAD * math.sin(angle), AMPLITUDE_RAD * (1.0 - math.cos(angle))]
        targets.publish(JointState(name=JOINTS, position=positions))
        time.sleep(1.0 / HZ)


if __name__ == "__main__":
    main()
