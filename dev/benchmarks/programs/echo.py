"""Republishes messages at once: the shortest way there and back through rospy."""

from __future__ import annotations

import sys

import rospy
from roslib.message import get_message_class


def main() -> None:
    """Echoes the topic of the first argument on that of the second; of joint states, or of the third's type."""
    source, destination, kind = [*sys.argv[1:], "sensor_msgs/JointState"][:3]
    message_type = get_message_class(kind)
    rospy.init_node("echo")
    publisher = rospy.Publisher(destination, message_type, queue_size=1000)
    rospy.Subscriber(source, message_type, publisher.publish, queue_size=100, tcp_nodelay=True)
    rospy.spin()


if __name__ == "__main__":
    main()
