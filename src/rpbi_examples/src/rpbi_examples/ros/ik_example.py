"""Takes an arm to the start of a figure eight and then has it track the figure, by a solver of `ik_ros`."""

from __future__ import annotations

import sys

import rospy
from geometry_msgs.msg import Point, Pose
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface
from ik_ros.msg import IKProblem
from ik_ros.srv import SolveIK
from ros_pybullet_interface.srv import ResetJointState

HOME = {"lwr_arm_1_joint": 0.52, "lwr_arm_3_joint": -1.57, "lwr_arm_5_joint": 1.05}
"""Where the search begins [rad]; other joints at 0."""
APPROACH_S = 5.0
"""Time for the way to the figure [s]."""


def main() -> None:
    """Runs the node for the robot and the solver that the arguments name."""
    run_node("ik_example", _run)


def _run() -> None:
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 2:
        raise InterfaceError(f"expected the names of a robot and a solver, got {len(arguments)}")
    robot, solver = arguments
    start = _start_of_the_figure(solver)
    _call(f"rpbi/{robot}/move_to_joint_state", ResetJointState, start, APPROACH_S)
    figure = ("toggle_figure_eight",) if rospy.get_param("~figure_moves", True) else ()
    for toggle in (f"ik/setup/{solver}/toggle", f"ik/solver/{solver}/toggle", *figure):
        _call(toggle, SetBool, True)
    rospy.loginfo("the arm tracks its target by '%s'", solver)


def _start_of_the_figure(solver: str) -> JointState:
    """Returns the joints' positions where the figure begins [rad]."""
    base, target = rospy.get_param("~base_frame"), rospy.get_param("~target_frame")
    transform = TfInterface().wait_for_tf_msg(base, target).transform
    problem = IKProblem(has_target=True, start=JointState(name=list(HOME), position=list(HOME.values())))
    problem.target = Pose(Point(*_components(transform.translation)), transform.rotation)
    return _call(f"ik/solver/{solver}/solve", SolveIK, problem).solution


def _components(vector: object) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _call(service: str, kind: type, *arguments: object) -> object:
    """Calls a service when it is there.

    Raises:
        InterfaceError: If it answers that it did not succeed.
    """
    proxy = rospy.ServiceProxy(service, kind)
    proxy.wait_for_service()
    answer = proxy(*arguments)
    if not answer.success:
        raise InterfaceError(f"{service}: {answer.message}")
    return answer
