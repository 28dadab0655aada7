"""Republishes joint states at once: the shortest way there and back through rospy."""

from __future__ import annotations

import sys

import rospy
from sensor_msgs.msg import JointState


def main() -> None:
    """Echoes the topic of the first argument on that of the second."""
    source, destination = sys.argv[1:3]
    rospy.init_node("echo")
    publisher = rospy.Publisher(destination, JointState, queue_size=1000)
    rospy.Subscriber(source, JointState, publisher.publish, queue_size=100, tcp_nodelay=True)
    rospy.spin()


if __name__ == "__main__":
    main()
