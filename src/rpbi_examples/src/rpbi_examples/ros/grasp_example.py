"""Moves an arm that picks up a box, carries it to another place and puts it down, by topics and services only."""

import math
from itertools import cycle

import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import call_service
from custom_ros_tools.ros.tf_interface import TfInterface
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import ResetEffState
from rpbi_examples.motions import GraspStep, PlanarPose, pick_and_place

LINK = "panda_grasptarget"
FINGER = "panda_finger_joint1"
GOALS = (PlanarPose(0.5, 0.2, 0.0), PlanarPose(0.4, -0.2, 0.35))
MOVE_S, FINGERS_S = 2.0, 1.0
"""Duration of a step of the hand or of the fingers [s]."""


def main() -> None:
    """Runs the node."""
    run_node("grasp_example", _run)


def _run() -> None:
    tf = TfInterface()
    fingers = rospy.Publisher("rpbi/panda/joint_states/target", JointState, queue_size=10, latch=True)
    for goal in cycle(GOALS):
        before = None
        for step in pick_and_place(_box(tf), goal):
            if before is not None and step.finger != before.finger:
                fingers.publish(JointState(name=[FINGER], position=[step.finger]))
                rospy.sleep(FINGERS_S)
            else:
                call_service("rpbi/panda/move_to_eff_state", ResetEffState, _problem(step), MOVE_S)
            before = step
        x, y, _ = _box(tf)
        off_mm = math.hypot(x - goal.x, y - goal.y) * 1e3
        rospy.loginfo("the box is %.2f mm from its place (%.2f, %.2f)", off_mm, goal.x, goal.y)
        rospy.sleep(FINGERS_S)


def _box(tf: TfInterface) -> PlanarPose:
    """Returns the pose of the box from TF."""
    position, quat = TfInterface.msg_to_pos_quat(tf.wait_for_tf_msg("rpbi/world", "rpbi/box"))
    return PlanarPose(position[0], position[1], 2.0 * math.atan2(quat[2], quat[3]))


def _problem(step: GraspStep) -> CalculateInverseKinematicsProblem:
    return CalculateInverseKinematicsProblem(
        link_name=LINK, targetPosition=step.position, targetOrientation=step.quat_xyzw, residualThreshold=1e-5
    )
