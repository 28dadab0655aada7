"""Nodes that move the robots of the examples, by topics and services of the simulator."""

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
"""Time for which the arm presses before it wipes [s]."""


def basic_robot_example() -> None:
    """Moves the joints of the robot that `~robot_name` or the first argument names, one after the other.

    They swing by `~amplitude` (1 rad or m) about 0, or with `~about_start` about their first positions.
    """
    run_node("basic_robot_example", _swing)


def wave() -> None:
    """Waves with the right hand of the human model that `~robot_name` or the first argument names."""
    run_node("wave", _wave)


def drive_around() -> None:
    """Drives the mobile base that `~robot_name` or the first argument names along a route, by its `base_state`."""
    run_node("drive_around", _drive)


def dual_arm_example() -> None:
    """Draws mirrored circles with the hands of two robots, which the arguments name, the left one first.

    The parameter `robot_description` has both. Targets of all joints go out on `joint_states/target`. The centres of
    the circles are `~distance` apart [m]; with 0.3 the targets cross the arms.
    """
    run_node("dual_arm_example", _draw)


def wiping_example() -> None:
    """Wipes back and forth with the KUKA of the wiping example once it touches the table."""
    run_node("wiping_example", _wipe)


def _robot_name() -> str:
    """Returns the robot that `~robot_name` or the first argument names.

    Raises:
        InterfaceError: If neither is given.
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
    """Sends a motion until ROS shuts down."""
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
