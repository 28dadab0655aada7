"""Three example nodes: an arm picks and places a box, an arm pushes a box, and boxes are thrown into the world."""

import math
from itertools import cycle

import rospy
from cob_srvs.srv import SetString
from sensor_msgs.msg import JointState

from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import call_service, get_srv_handler
from custom_ros_tools.ros.tf_interface import TfInterface
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem, PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject, ResetEffState
from rpbi_examples.motions import GraspStep, PlanarPose, pick_and_place
from rpbi_examples.pushing import PLACES, Pusher, ball_solver, next_push

from .joint_targets import HZ, JointTargets

HAND_LINK, FINGER = "panda_grasptarget", "panda_finger_joint1"
GRASP_GOALS = (PlanarPose(0.5, 0.2, 0.0), PlanarPose(0.4, -0.2, 0.35))
MOVE_S, FINGERS_S = 2.0, 1.0
"""Duration of a motion of the hand, and of a motion of the fingers [s]."""
ROBOT = "kuka_lwr"
REST_S = 0.5
"""Time for which the arm rests at the start, and after a box was found out of reach [s]."""
BOX = "{rpbi_examples}/configs/pybullet_objects_example/box.yaml"
NAME = "box"
STAY_S = 3.0
"""ROS time for which each box stays in the world [s]."""


def grasp_example() -> None:
    """Runs the node with which an arm repeatedly picks up a box, carries the box to another goal and puts it down."""
    run_node("grasp_example", _pick_and_place)


def _pick_and_place() -> None:
    tf = TfInterface()
    fingers = rospy.Publisher("rpbi/panda/joint_states/target", JointState, queue_size=10, latch=True)
    for goal in cycle(GRASP_GOALS):
        before = None
        for step in pick_and_place(_box(tf, "rpbi/world"), goal):
            if before is not None and step.finger != before.finger:
                fingers.publish(JointState(name=[FINGER], position=[step.finger]))
                rospy.sleep(FINGERS_S)
            else:
                call_service("rpbi/panda/move_to_eff_state", ResetEffState, _problem(step), MOVE_S)
            before = step
        x, y, _ = _box(tf, "rpbi/world")
        off_mm = math.hypot(x - goal.x, y - goal.y) * 1e3
        rospy.loginfo("the box is %.2f mm from its place (%.2f, %.2f)", off_mm, goal.x, goal.y)
        rospy.sleep(FINGERS_S)


def _box(tf: TfInterface, frame: str) -> PlanarPose:
    """Looks up the pose of the box in a TF frame, projected onto the floor."""
    position, quat = TfInterface.msg_to_pos_quat(tf.wait_for_tf_msg(frame, "rpbi/box"))
    return PlanarPose(position[0], position[1], 2.0 * math.atan2(quat[2], quat[3]))


def _problem(step: GraspStep) -> CalculateInverseKinematicsProblem:
    return CalculateInverseKinematicsProblem(
        link_name=HAND_LINK, targetPosition=step.position, targetOrientation=step.quat_xyzw, residualThreshold=1e-5
    )


def push_example() -> None:
    """Runs the node with which an arm pushes a box back and forth between two goals."""
    run_node("push_example", _push)


def _push() -> None:
    tf, arm, pusher = TfInterface(), JointTargets(ROBOT), Pusher(ball_solver())
    positions = arm.positions
    _rest(arm, positions)
    for goal in cycle(PLACES):
        while (push := next_push(_box(tf, f"rpbi/{ROBOT}/base"), goal)) is not None:
            try:
                moves = pusher.moves(positions, push)
            except ValueError as error:
                rospy.logwarn_throttle(10.0, f"the box cannot be pushed: {error}")
                _rest(arm, positions)
                continue
            for move in moves:
                ticks = round(move.duration_s * HZ)
                for tick in range(1, ticks + 1):
                    positions = move.at(tick / ticks * move.duration_s)
                    arm.send(positions)


def _rest(arm: JointTargets, positions: tuple[float, ...]) -> None:
    for _ in range(round(REST_S * HZ)):
        arm.send(positions)


def pybullet_objects_example() -> None:
    """Runs the node that repeatedly throws a box into the world and removes the box."""
    run_node("pybullet_objects_example", _throw_boxes)


def _throw_boxes() -> None:
    add = get_srv_handler("rpbi/add_pybullet_object", AddPybulletObject)
    remove = rospy.ServiceProxy("rpbi/remove_pybullet_object", SetString)
    box = PybulletObject(object_type=PybulletObject.DYNAMIC, filename=BOX)
    while not rospy.is_shutdown():
        try:
            answer = add(box)
            if not answer.success:
                rospy.logwarn("the box was refused: %s", answer.message)
            rospy.sleep(STAY_S)
            remove(NAME)
        except rospy.ServiceException as error:
            rospy.logwarn("the simulator does not answer: %s", error)
            rospy.sleep(STAY_S)
