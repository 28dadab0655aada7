"""Stamps of what people do."""

import time

import rospy


def stamp() -> rospy.Time:
    """Returns the present ROS time; where that is simulated and has not begun, wall time."""
    now = rospy.Time.now()
    return rospy.Time.from_sec(time.time()) if now.is_zero() else now
