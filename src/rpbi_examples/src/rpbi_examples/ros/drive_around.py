"""Drives a mobile base along a route by `cmd_vel`, steered by its `base_state`."""

from __future__ import annotations

import math

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from custom_ros_tools.ros.lifecycle.run_node import run_node
from rpbi_examples.route import PlanarPose, Route

from .arguments import robot_name


def main() -> None:
    """Runs the node for the robot named by `~robot_name` or the first argument."""
    run_node("drive_around", _start)


def _start() -> rospy.Subscriber:
    name = robot_name()
    route = Route()
    publisher = rospy.Publisher(f"rpbi/{name}/cmd_vel", Twist, queue_size=1)

    def drive(state: Odometry) -> None:
        velocity = route.velocity(_planar(state))
        command = Twist()
        command.linear.x, command.linear.y, command.angular.z = velocity
        publisher.publish(command)

    return rospy.Subscriber(f"rpbi/{name}/base_state", Odometry, drive, queue_size=1)


def _planar(state: Odometry) -> PlanarPose:
    position, quat = state.pose.pose.position, state.pose.pose.orientation
    return PlanarPose(position.x, position.y, 2.0 * math.atan2(quat.z, quat.w))
