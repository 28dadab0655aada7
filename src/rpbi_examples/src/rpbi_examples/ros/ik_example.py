"""`ik_example_node.py`: moves an arm to a target frame and then tracks the target, with a solver of `ik_ros`."""

import sys

import numpy as np
import rospy
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import call_service
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose
from custom_ros_tools.transforms import pose_of
from ik_ros.msg import IKProblem, Waypoint
from ik_ros.srv import SolveIK
from ros_pybullet_interface.srv import ResetJointState
from rpbi_examples.motions import FigureEight

from .joint_targets import wait_until_ready

HOME = {"lwr_arm_1_joint": 0.52, "lwr_arm_3_joint": -1.57, "lwr_arm_5_joint": 1.05}
"""Default of `~home`: joint positions from which inverse kinematics start [rad]. Joints without a value are at 0."""
APPROACH_S = 5.0
"""Duration of the motion to the target or to the figure [s]."""
WAYPOINTS = 16
"""Number of waypoints for one round of the figure, with the solver of whole trajectories."""
WHOLE_TRAJECTORIES = "trajectory"


def main() -> None:
    """Runs the node. The first argument names the robot, the second argument the solver."""
    run_node("ik_example", _run)


def _run() -> None:
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 2:
        raise InterfaceError(f"expected the names of a robot and a solver, got {len(arguments)}")
    robot, solver = arguments
    base, target = rospy.get_param("~base_frame"), rospy.get_param("~target_frame")
    wait_until_ready()
    in_base = TfInterface.msg_to_matrix(TfInterface().wait_for_tf_msg(base, target))
    if solver == WHOLE_TRAJECTORIES:
        _draw_a_round(robot, in_base)
    else:
        _track(robot, solver, in_base)


def _track(robot: str, solver: str, target: np.ndarray) -> None:
    """Moves the arm to the pose `target`, a matrix of shape (4, 4), and then starts the tracking of the target.

    Switches on the solver and the solver's setup node. If `~target_toggle` is given, also switches on the motion of
    the target.
    """
    problem = IKProblem(has_target=True, target=_pose(target), start=_home())
    start = call_service(f"ik/solver/{solver}/solve_ik", SolveIK, problem).solution
    call_service(f"rpbi/{robot}/move_to_joint_state", ResetJointState, start, APPROACH_S)
    toggles = (f"ik/setup/{solver}/toggle", f"ik/solver/{solver}/toggle", rospy.get_param("~target_toggle", ""))
    for toggle in filter(None, toggles):
        call_service(toggle, SetBool, True)
    rospy.loginfo("the arm tracks its target by '%s'", solver)


def _draw_a_round(robot: str, start: np.ndarray) -> None:
    """Plans and publishes one trajectory, which leads to the figure eight and once around the figure.

    Args:
        robot: Name of the robot, whose trajectory controller receives the trajectory.
        start: Pose of the figure's frame in the frame of the robot's base, shape (4, 4).
    """
    figure = FigureEight()
    times_s = figure.period_s / WAYPOINTS * np.arange(WAYPOINTS + 1)
    problem = IKProblem(start=_home())
    for time_s in times_s:
        shifted = start @ TfInterface.pos_quat_to_matrix(figure.position(time_s))
        problem.waypoints.append(Waypoint(rospy.Duration.from_sec(APPROACH_S + time_s), _pose(shifted)))
    answer = call_service(f"ik/solver/{WHOLE_TRAJECTORIES}/solve", SolveIK, problem)
    call_service(f"rpbi/{robot}/move_to_joint_state", ResetJointState, _home(), APPROACH_S)
    command = rospy.Publisher(
        f"rpbi/{robot}/joint_trajectory_controller/command", JointTrajectory, queue_size=1, latch=True
    )
    command.publish(answer.trajectory)
    rospy.loginfo("the arm draws the figure along one trajectory of %d points", len(answer.trajectory.points))
    rospy.sleep(APPROACH_S)
    call_service("toggle_figure_eight", SetBool, True)


def _home() -> JointState:
    positions: dict[str, float] = rospy.get_param("~home", HOME)
    return JointState(name=list(positions), position=list(positions.values()))


def _pose(matrix: np.ndarray) -> Pose:
    return as_pose(TfInterface.pack_tf(*pose_of(matrix)))
