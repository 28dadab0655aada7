"""Publishes joint targets at 100 Hz until it is stopped, bad ones among good ones.

Arguments: the topic, the joint of the good ones and where it shall be.
"""

from __future__ import annotations

import itertools
import math
import sys
import time

import rospy
from sensor_msgs.msg import JointState


def main() -> None:
    """Publishes."""
    topic, joint, goal = sys.argv[1], sys.argv[2], float(sys.argv[3])
    bad = (
        JointState(name=[joint], position=[math.nan]),
        JointState(name=[joint, "lbr_iiwa_joint_1"], position=[-0.5, math.inf]),
        JointState(name=[joint, "lbr_iiwa_joint_1"], position=[-0.5]),
        JointState(name=[joint, "elbow"], position=[-0.5, 0.1]),
        JointState(name=[joint], velocity=[1.0]),
        JointState(name=[joint], effort=[1.0]),
        JointState(name=[joint, joint], position=[-0.5, -0.5]),
        JointState(position=[-0.5] * 7),
        JointState(name=[""], position=[-0.5]),
    )
    rospy.init_node("flood_targets", anonymous=True, disable_rostime=True)
    publisher = rospy.Publisher(topic, JointState, queue_size=100)
    for message in itertools.cycle(bad):
        if rospy.is_shutdown():
            return
        publisher.publish(message)
        publisher.publish(JointState(name=[joint], position=[goal]))
        time.sleep(0.01)


if __name__ == "__main__":
    main()
