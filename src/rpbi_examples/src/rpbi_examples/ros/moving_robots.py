"""Nodes that move the robots of the examples through topics and services of the simulator."""

import math
import sys
import threading
from typing import NoReturn

import rospy
from geometry_msgs.msg import Point, PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.tf import TfInterface
from robot_model.urdf.files import write_description
from ros_pybullet_interface.msg import Contacts
from rpbi_examples.motions import CIRCLE_CENTRE, SWING_AMPLITUDE, PlanarPose, Route, Swing, Wave, wiped
from rpbi_examples.two_hands import MirroredHands

from .joint_targets import HZ, JointTargets

SETTLING_S = 0.5
"""Time between the first contact with the table and the start of wiping [s]."""


def basic_robot_example() -> None:
    """Runs the node that swings a robot's joints, one after the other.

    `~robot_name` or the first argument names the robot. The joints swing by `~amplitude` (default: 1 rad or m) about 0.
    With `~about_start`, the joints swing about their initial positions.
    """
    run_node("basic_robot_example", _swing)


def wave() -> None:
    """Runs the node with which a human model waves. `~robot_name` or the first argument names the model."""
    run_node("wave", _wave)


def drive_around() -> None:
    """Runs the node that drives a mobile base along a closed route.

    `~robot_name` or the first argument names the base. The node reads `base_state` and publishes `cmd_vel`.
    """
    run_node("drive_around", _drive)


def dual_arm_example() -> None:
    """Runs the node that draws mirrored circles with the hands of two robots.

    The two arguments name the robots, the left robot first. The parameter `robot_description` contains both robots. The
    node publishes targets for all joints on `joint_states/target`. `~distance` is the distance between the centres of
    the circles [m]; at 0.3 m, the targets make the arms cross.
    """
    run_node("dual_arm_example", _draw)


def wiping_example() -> None:
    """Runs the node with which a KUKA wipes a table back and forth. Wiping starts after the first contact."""
    run_node("wiping_example", _wipe)


def _robot_name() -> str:
    """Returns the robot's name from `~robot_name`, or otherwise from the first argument.

    Raises:
        InterfaceError: If both are missing.
    """
    arguments = rospy.myargv(sys.argv)[1:]
    name = rospy.get_param("~robot_name", arguments[0] if arguments else None)
    if name is None:
        raise InterfaceError("which robot? Give its name as ~robot_name or as first argument")
    return str(name)


def _swing() -> None:
    robot = JointTargets(_robot_name())
    lower, upper = zip(*robot.limits)
    middle = robot.positions if rospy.get_param("~about_start", False) else None
    swing = Swing(robot.positions, lower, upper, middle, float(rospy.get_param("~amplitude", SWING_AMPLITUDE)))
    _play(robot, swing)


def _wave() -> None:
    robot = JointTargets(_robot_name())
    _play(robot, Wave(robot.names, robot.positions))


def _play(robot: JointTargets, motion: Swing | Wave) -> NoReturn:
    """Publishes the targets of a motion until ROS shuts down."""
    time_s = 0.0
    while True:
        robot.send(motion.at(time_s))
        time_s += 1.0 / HZ


def _drive() -> rospy.Subscriber:
    name = _robot_name()
    route = Route()
    publisher = rospy.Publisher(f"rpbi/{name}/cmd_vel", Twist, queue_size=1)

    def drive(state: Odometry) -> None:
        position, quat = state.pose.pose.position, state.pose.pose.orientation
        pose = PlanarPose(position.x, position.y, 2.0 * math.atan2(quat.z, quat.w))
        command = Twist()
        command.linear.x, command.linear.y, command.angular.z = route.velocity(pose)
        publisher.publish(command)

    return rospy.Subscriber(f"rpbi/{name}/base_state", Odometry, drive, queue_size=1)


def _draw() -> None:
    names = rospy.myargv(sys.argv)[1:]
    if len(names) != 2:
        raise InterfaceError(f"expected the names of two robots, got {len(names)}")
    arms = JointTargets(*names)
    urdf = write_description(str(rospy.get_param("robot_description")))
    distance = float(rospy.get_param("~distance", 2.0 * CIRCLE_CENTRE[1]))
    hands = MirroredHands(urdf, names, dict(zip(arms.names, arms.positions)), distance)
    reached: set[str] = set()
    for name in names:
        rospy.Subscriber(f"rpbi/{name}/joint_states/target", JointState, lambda _, name=name: reached.add(name))
    while len(reached) < len(names):  # a guard accepts a first target only at the present positions
        arms.send(arms.positions)
    time_s = 0.0
    while True:
        arms.send(hands.at(time_s))
        time_s += 1.0 / HZ


def _wipe() -> None:
    touched = threading.Event()

    def look(message: Contacts) -> None:
        if any(point.other_body == "table" for point in message.points):
            touched.set()

    contacts = rospy.Subscriber("rpbi/kuka_lwr/contacts", Contacts, look, queue_size=1)
    while not touched.wait(0.1):  # repeated wait_for_message may never get a connection
        if rospy.is_shutdown():
            return
    contacts.unregister()
    rospy.sleep(SETTLING_S)
    start_pose = TfInterface().wait_for_tf_msg("rpbi/world", "rpbi/kuka_lwr/end_effector_ball")
    if start_pose is None:
        return  # ROS shuts down
    middle = start_pose.transform.translation
    publisher = rospy.Publisher("rpbi/kuka_lwr/wipe/target", PoseStamped, queue_size=1)
    target = PoseStamped(header=Header(frame_id="rpbi/world"))
    target.pose.orientation = start_pose.transform.rotation
    rate = rospy.Rate(HZ)
    start = rospy.Time.now()
    while not rospy.is_shutdown():
        target.header.stamp = rospy.Time.now()
        way = wiped((target.header.stamp - start).to_sec())
        target.pose.position = Point(middle.x, middle.y + way, middle.z)
        publisher.publish(target)
        rate.sleep()
