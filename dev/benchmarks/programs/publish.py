"""Publishes joint states at a rate and does nothing else: as well as rospy can."""

from __future__ import annotations

import sys
import time

import genpy
import rospy
from sensor_msgs.msg import JointState

JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]


def main() -> None:
    """Publishes on a topic at a rate [Hz] by absolute deadlines, stamped by them."""
    topic, hz = sys.argv[1], float(sys.argv[2])
    rospy.init_node("publish", disable_signals=True)
    publisher = rospy.Publisher(topic, JointState, queue_size=1000)
    period_ns = round(1e9 / hz)
    start_ns = time.monotonic_ns()
    tick = 0
    while True:
        tick += 1
        left_ns = start_ns + tick * period_ns - time.monotonic_ns()
        if left_ns > 0:
            time.sleep(left_ns * 1e-9)
        message = JointState(name=JOINTS, position=[0.1] * 7, velocity=[0.2] * 7, effort=[0.3] * 7)
        message.header.stamp = genpy.Time(*divmod(tick * period_ns, 1_000_000_000))
        publisher.publish(message)


if __name__ == "__main__":
    main()
