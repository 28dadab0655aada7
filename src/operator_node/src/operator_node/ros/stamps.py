"""Stamps of what people do."""

import time

import rospy


def stamp() -> rospy.Time:
    """Returns the present ROS time; where that is simulated and has not begun, wall time."""
    now = rospy.Time.now()
    return rospy.Time.from_sec(time.time()) if now.is_zero() else now


def has_begun() -> bool:
    """Returns whether ROS time has begun; to TF, what has a wall stamp before would be newer than all that follows."""
    return not rospy.Time.now().is_zero()
