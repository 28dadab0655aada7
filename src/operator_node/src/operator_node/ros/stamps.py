"""Stamps of user input."""

import time

import rospy


def stamp() -> rospy.Time:
    """Returns the present ROS time; wall time if simulated time has not started."""
    now = rospy.Time.now()
    return rospy.Time.from_sec(time.time()) if now.is_zero() else now


def has_begun() -> bool:
    """Returns whether ROS time has started; for TF, transforms with earlier wall stamps would be newer than all later
    ones.
    """
    return not rospy.Time.now().is_zero()
