"""Subscribes to topics and does nothing with what comes; for tests that stop it with SIGSTOP."""

from __future__ import annotations

import sys

import rospy


def main() -> None:
    """Subscribes to all topics that are named as arguments, and says so once something has come on each."""
    rospy.init_node("hold_topics", anonymous=True, disable_rostime=True)
    silent = set(sys.argv[1:])
    for topic in sys.argv[1:]:
        rospy.Subscriber(topic, rospy.AnyMsg, lambda _, topic=topic: silent.discard(topic))
    while silent:  # a subscriber counts connections not made yet
        rospy.rostime.wallsleep(0.02)
    print("listening", flush=True)
    rospy.spin()


if __name__ == "__main__":
    main()
