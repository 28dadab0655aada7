"""The node of `planning_example.launch`: carries boxes between two bookcases, with motions of the planner."""

from __future__ import annotations

from itertools import count

import rospy
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.action_client import ActionClient
from custom_ros_tools.ros.lifecycle.end_launch import end_launch
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface
from robot_model.geometry import Vector
from rpbi_examples.shelving import LEFT, LINK, RIGHT, Step, carry
from rpbi_planning.msg import MotionRequest, MoveRobotAction, MoveRobotGoal

from .joint_targets import wait_until_ready

BOXES = ("box_1", "box_2", "box_3")
WORLD = "rpbi/world"
FINGER = "panda_finger_joint1"
FINGERS_S = 1.0
"""Duration of a motion of the fingers [s of ROS time]."""
TRIES, PAUSE_S = 5, 2.0
"""Largest number of requests for a motion, and time between two of them [s of ROS time]."""


def planning_example() -> None:
    """Runs the node that carries all boxes into the other bookcase, and then back, `~rounds` times; 0: forever."""
    run_node("planning_example", _carry_boxes)


def _carry_boxes() -> None:
    tf = TfInterface()
    fingers = rospy.Publisher("rpbi/panda/joint_states/target", JointState, queue_size=10, latch=True)
    planner = ActionClient("planner/move_robot", MoveRobotAction)
    planner.wait_for_server()
    wait_until_ready()
    rounds = int(rospy.get_param("~rounds", 0))
    for number in count(1):
        for box in BOXES:
            place = _place(tf, box)
            source, goal = (LEFT, RIGHT) if LEFT.has(place) else (RIGHT, LEFT)
            for step in carry(place, source, goal):
                if step.finger is not None:
                    fingers.publish(JointState(name=[FINGER], position=[step.finger]))
                    rospy.sleep(FINGERS_S)
                else:
                    _move(planner, box, step)
            rospy.loginfo("%s is in '%s'", box, goal.name if goal.has(_place(tf, box)) else "another place")
        if number == rounds:
            end_launch("all boxes are carried")
            return


def _place(tf: TfInterface, box: str) -> Vector:
    """Looks up the position of a box in the world [m]."""
    position, _ = TfInterface.msg_to_pos_quat(tf.wait_for_tf_msg(WORLD, f"rpbi/{box}"))
    x, y, z = map(float, position)
    return x, y, z


def _move(planner: ActionClient, box: str, step: Step) -> None:
    """Moves the hand, and tries again if there is no path.

    Raises:
        InterfaceError: If the last attempt fails.
    """
    for seed in range(TRIES):
        planner.send_goal(MoveRobotGoal(motion_request(box, step, seed)))
        planner.wait_for_result()
        result = planner.get_result()
        if result is not None and result.success:
            return
        if rospy.is_shutdown():
            raise rospy.ROSInterruptException("ROS shuts down")
        rospy.logwarn("%s: %s", box, result.message if result else "no result")
        rospy.sleep(PAUSE_S)
    raise InterfaceError(f"{box}: the hand cannot move to {step.pose}")


def motion_request(box: str, step: Step, seed: int) -> MotionRequest:
    """Returns the request for a step that moves the hand; `box` is the box that it holds or grasps."""
    assert step.pose is not None
    request = MotionRequest(robot="panda", link=LINK, seed=seed)
    request.pose = PoseStamped(pose=PoseMessage(Point(*step.pose.position), Quaternion(*step.pose.quat_xyzw)))
    if step.held:
        request.held, request.held_link = [box], "panda_hand"
        request.may_touch = [step.may_touch] if step.may_touch else []
    return request
