"""Subscribes to topics and does nothing with what comes; for tests that stop it with SIGSTOP."""

from __future__ import annotations

import sys

import rospy


def main() -> None:
    """Subscribes to all topics that are named as arguments."""
    rospy.init_node("hold_topics", anonymous=True, disable_rostime=True)
    subscribers = [rospy.Subscriber(topic, rospy.AnyMsg, lambda message: None) for topic in sys.argv[1:]]
    while not all(subscriber.get_num_connections() for subscriber in subscribers):
        rospy.rostime.wallsleep(0.02)
    print("listening", flush=True)
    rospy.spin()


if __name__ == "__main__":
    main()
