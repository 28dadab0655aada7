"""`run_teleop.py` and `run_example.py`: nodes that move an arm's tip to a frame and then make the tip follow the frame.

Topics, services, frames and parameters have the same names as in the original release of this project
(docs/from_the_release.md).
"""

import sys
from collections.abc import Sequence

import rospy
from keyboard.msg import Key
from std_srvs.srv import SetBool, Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.key_down_subscriber import KeyDownSubscriber
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import call_service
from custom_ros_tools.tf import TfInterface
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import ResetEffState

WORLD = "rpbi/world"
START_S, APPROACH_S = 2.0, 5.0
"""Duration of the motion to the origin of teleoperation, and of the motion to the figure eight [s]."""
NEAR_M = 0.03
"""Largest distance of the tip from the origin at which teleoperation can be switched on [m]."""
ITERATIONS, RESIDUAL = 1000, 1e-7
"""Iterations and tolerance of inverse kinematics. With the defaults, the solver stops before the target orientation."""
PYBULLET = "pybullet"
"""Name of the solver inside the simulator, which solves the targets on the robot's topic `ik`."""


def run_teleop() -> None:
    """Runs the node for teleoperation. Key 1 moves the tip to the origin, key 2 switches teleoperation on and off."""
    run_node("run_teleop", KeyedTeleop)


def run_example() -> None:
    """Runs the node that moves the tip to `figure_eight_base` and then starts the tracking of a moving frame.

    The frame moves along a figure eight. The first argument names the IK solver.
    """
    run_node("run_example", _track_figure)


class KeyedTeleop:
    """On key presses, moves an arm's tip to the origin of teleoperation, or switches teleoperation on and off."""

    def __init__(self) -> None:
        self._robot, self._link = rospy.get_param("~robot_name", "kuka_lwr"), "end_effector_ball"
        solver = rospy.get_param("~ik", "trac_ik")
        self._toggles = ("operator_node/toggle", "toggle_teleop_tf", *_toggles(solver))
        self._tf = TfInterface()
        self._is_on = False
        KeyDownSubscriber({Key.KEY_1: self._move_to_origin, Key.KEY_2: self._switch})
        rospy.loginfo("key 1 moves the arm to its origin; key 2 switches teleoperation on, and off again")

    def _move_to_origin(self) -> None:
        if self._is_on:
            rospy.logwarn("teleoperation is on; key 2 switches it off")
            return
        try:
            _move_to(self._tf, self._robot, self._link, "teleop_origin", START_S)
        except InterfaceError as error:
            rospy.logwarn("%s", error)
            return
        rospy.loginfo("the arm is at its origin")

    def _switch(self) -> None:
        try:
            if not self._is_on:
                self._check_place()
                call_service("reset_teleop_transform_to_zero", Trigger)
            _switch(self._toggles, not self._is_on)
        except InterfaceError as error:
            rospy.logwarn("%s", error)
            return
        self._is_on = not self._is_on
        rospy.loginfo("teleoperation is %s", "on" if self._is_on else "off")

    def _check_place(self) -> None:
        """Checks that the tip is near the origin; raises an InterfaceError otherwise."""
        position, _ = self._tf.get_tf("teleop_origin", f"rpbi/{self._robot}/{self._link}")
        if position is None:
            raise InterfaceError("TF has no teleop_origin, or no tip of the arm")
        distance_m = float(sum(each**2 for each in position) ** 0.5)
        if distance_m > NEAR_M:
            raise InterfaceError(
                f"the tip is {distance_m:.3f} m from its origin, limit {NEAR_M} m; key 1 moves it there"
            )


def _track_figure() -> None:
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        raise InterfaceError(f"expected the name of a solver, got {len(arguments)} arguments")
    solver = arguments[0]
    robot, link = rospy.get_param("~robot_name"), rospy.get_param("~eff_name")
    try:
        _move_to(TfInterface(), robot, link, "figure_eight_base", APPROACH_S)
    except InterfaceError as error:
        rospy.logwarn("%s; the arm goes to the figure from where it is", error)
    _switch((*_toggles(solver), "toggle_figure_eight"), True)
    rospy.loginfo("the arm tracks the figure by '%s'", solver)


def _toggles(solver: str) -> Sequence[str]:
    """Returns the names of the services that switch a solver on and off."""
    setup = f"ik/setup/{solver}/toggle"
    return (setup,) if solver == PYBULLET else (setup, f"ik/solver/{solver}/toggle")


def _switch(services: Sequence[str], is_on: bool) -> None:
    for service in services:
        call_service(service, SetBool, is_on)


def _move_to(tf: TfInterface, robot: str, link: str, frame: str, duration_s: float) -> None:
    """Moves a link to a TF frame in a given time [s]; raises an InterfaceError if the service fails."""
    position, quat_xyzw = tf.wait_for_tf(WORLD, frame)
    problem = CalculateInverseKinematicsProblem(link_name=link, targetPosition=position, targetOrientation=quat_xyzw)
    problem.maxNumIterations, problem.residualThreshold = ITERATIONS, RESIDUAL
    call_service(f"rpbi/{robot}/move_to_eff_state", ResetEffState, problem, duration_s)
