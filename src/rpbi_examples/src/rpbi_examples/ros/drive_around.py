"""Drives a mobile base along a route by `cmd_vel`, steered by its `base_state`."""

from __future__ import annotations

import math
import sys

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from ..route import PlanarPose, Route


def main() -> None:
    """Runs the node for the robot named by `~robot_name` or the first argument."""
    rospy.init_node("drive_around")
    arguments = rospy.myargv(sys.argv)[1:]
    name = rospy.get_param("~robot_name", arguments[0] if arguments else None)
    if name is None:
        rospy.logfatal("which robot? Give its name as ~robot_name or as first argument")
        sys.exit(1)
    route = Route()
    publisher = rospy.Publisher(f"rpbi/{name}/cmd_vel", Twist, queue_size=1)

    def drive(state: Odometry) -> None:
        velocity = route.velocity(_planar(state))
        command = Twist()
        command.linear.x, command.linear.y, command.angular.z = velocity
        publisher.publish(command)

    rospy.Subscriber(f"rpbi/{name}/base_state", Odometry, drive, queue_size=1)
    rospy.spin()


def _planar(state: Odometry) -> PlanarPose:
    position, quat = state.pose.pose.position, state.pose.pose.orientation
    return PlanarPose(position.x, position.y, 2.0 * math.atan2(quat.z, quat.w))
