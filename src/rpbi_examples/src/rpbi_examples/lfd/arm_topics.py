"""Moves the robot's arm through topics and services: to positions, by teleoperation, and along plans."""

from __future__ import annotations

import math

import numpy as np
import rospy
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Pose, TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool
from teleop.srv import GetBoxLimits

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.services import call_service, get_srv_handler
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose, transform_message
from custom_ros_tools.transforms import Array, pose_of, yaw_of
from ik_ros.msg import IKProblem
from ik_ros.srv import SolveIK, SolveIKResponse
from ros_pybullet_interface.srv import ResetJointState
from rpbi_examples.motions import PlanarPose

from .skill import PushPlan

ORIGIN, TARGET, TARGET_TIP, TIP = (
    "rpbi/teleop_origin",
    "rpbi/teleop_target",
    "teleop_target",
    "rpbi/kuka_lwr/end_effector_ball",
)
BASE = "rpbi/kuka_lwr/lwr_arm_0_link"
HOME = {"lwr_arm_1_joint": 0.2, "lwr_arm_3_joint": -1.6, "lwr_arm_5_joint": 1.35}
"""Posture with the tip above the box [rad]. Joints without a value are at 0."""
HOME_S, START_S = 2.0, 1.0
"""Duration of the motion to `HOME`, and of the motion from `HOME` to a start position [s]."""
SIGNAL_HZ = 50.0
RETURN_RATE = 3.0
"""Speed with which the target returns to the plan, divided by the target's distance from the plan [1/s]."""
LAG_M, SLACK_M = 0.02, 0.01
"""Largest lag of the tip behind the plan at full speed, and additional lag at which the plan has half its speed [m].

The plan waits for the arm by phase stopping: Ijspeert et al., Dynamical Movement Primitives, Neural Computation 25(2).
"""
MIN_PACE = 0.1
"""Least speed of the plan as a share of its full speed, so that the plan ends even if the arm cannot follow."""
BEYOND_M = 0.02
"""Distance by which a plan may exceed the limits of teleoperation [m]. The target itself stops at the limits."""
END_S = 0.5
"""Time for which the target stays at the end of a plan [s]."""


class Arm:
    """Moves the arm's tip, and switches the person's teleoperation of the arm on and off.

    A place is a position x, y in the person's frame `rpbi/teleop_origin`, shape (2,) [m].

    Args:
        tf: Access to TF.
        solver: Name of the IK solver in `ik_ros`.
    """

    def __init__(self, tf: TfInterface, solver: str) -> None:
        self._tf, self._solver = tf, solver
        self._toggles = (f"ik/setup/{solver}/toggle", f"ik/solver/{solver}/toggle", "toggle_teleop_tf")
        self._follows_person = False
        self._signal = rospy.Publisher("operator_node/signal", Float64MultiArray, queue_size=10)
        limits = get_srv_handler("teleop_box_limits", GetBoxLimits)()
        self._limits = np.array([limits.xlim, limits.ylim])

    def home(self) -> None:
        """Ends teleoperation, and raises the tip far above the box."""
        self._switch(False)
        self._move(JointState(name=list(HOME), position=list(HOME.values())), HOME_S)

    def go_to(self, place: Array) -> None:
        """Moves the tip from home down to a place, and starts teleoperation from there.

        Raises:
            InterfaceError: If the place is out of reach.
        """
        self._move(self._solution(place).solution, START_S)
        call_service("reset_teleop_transform", SetTransform, transform_message((*place, 0.0), (0.0, 0.0, 0.0)))
        self._switch(True)

    def require_reach(self, place: Array, subject: str) -> None:
        """Checks that the tip can reach a place.

        Args:
            place: The place.
            subject: Name of the place, with which the error message begins.

        Raises:
            InterfaceError: If the place is out of reach.
        """
        answer = self._solution(place, required=False)
        if not answer.success:
            raise InterfaceError(f"{subject} is out of reach: {answer.message}")

    def require_plan(self, plan: PushPlan) -> None:
        """Checks that a plan exceeds the position limits of teleoperation by at most `BEYOND_M`.

        Raises:
            InterfaceError: If the plan exceeds the limits by more.
        """
        for axis, (lower, upper), column in zip("xy", self._limits, plan.places.T):
            if column.min() < lower - BEYOND_M or column.max() > upper + BEYOND_M:
                got = f"{column.min():.3f} to {column.max():.3f}"
                raise InterfaceError(
                    f"the plan leaves the limits of teleoperation: {axis} from {lower:g} to {upper:g} m, got {got}"
                )

    def follow(self, plan: PushPlan) -> None:
        """Moves the tip's target along a plan, and returns at the end of the plan.

        Publishes velocities on the topic on which the operator node publishes the person's signals. Until the end, the
        operator node is switched off.
        """
        call_service("operator_node/toggle", SetBool, False)  # signals of the person are ignored meanwhile
        try:
            now, rate = rospy.Time.now(), rospy.Rate(SIGNAL_HZ)
            begin, phase_s = now, 0.0
            while phase_s < plan.duration_s + END_S:
                last, now = now, rospy.Time.now()
                pace = self._pace(plan.at(phase_s)[0])
                phase_s += pace * (now - last).to_sec()
                velocity = pace * plan.at(phase_s)[1]
                message = self._tf.get_tf_msg(ORIGIN, TARGET)
                if message is not None and message.header.stamp > begin:
                    planned = plan.at(phase_s - pace * (now - message.header.stamp).to_sec())[0]
                    there = message.transform.translation
                    velocity = velocity + RETURN_RATE * (planned - (there.x, there.y))
                self._signal.publish(Float64MultiArray(data=[*velocity.tolist(), 0.0]))
                rate.sleep()
            self._signal.publish(Float64MultiArray(data=[0.0, 0.0, 0.0]))
        finally:
            call_service("operator_node/toggle", SetBool, True)

    def _pace(self, planned: Array) -> float:
        """Returns the speed along the plan, relative to the planned speed: 1, or less while the tip lags behind.

        Args:
            planned: Present place in the plan.
        """
        message = self._tf.get_tf_msg(ORIGIN, TIP)
        if message is None:
            return 1.0
        there = message.transform.translation
        lag = math.hypot(planned[0] - there.x, planned[1] - there.y)
        return max(1.0 / (1.0 + (max(lag - LAG_M, 0.0) / SLACK_M) ** 2), MIN_PACE)

    def _switch(self, on: bool) -> None:
        """Switches the person's teleoperation of the arm on or off."""
        if on != self._follows_person:
            for toggle in self._toggles:
                call_service(toggle, SetBool, on)
        self._follows_person = on

    def _move(self, state: JointState, duration_s: float) -> None:
        call_service("rpbi/kuka_lwr/move_to_joint_state", ResetJointState, state, duration_s)

    def _solution(self, place: Array, required: bool = True) -> SolveIKResponse:
        start = JointState(name=list(HOME), position=list(HOME.values()))
        problem = IKProblem(has_target=True, target=self._tip_pose(place), start=start)
        call = call_service if required else (lambda name, kind, ask: get_srv_handler(name, kind)(ask))
        return call(f"ik/solver/{self._solver}/solve_ik", SolveIK, problem)

    def _tip_pose(self, place: Array) -> Pose:
        """Returns the pose of the tip at a place, in the frame of the arm's base."""
        origin, tip = (
            TfInterface.msg_to_matrix(self._tf.wait_for_tf_msg(*frames))
            for frames in ((BASE, ORIGIN), (TARGET, TARGET_TIP))
        )
        return as_pose(TfInterface.pack_tf(*pose_of(origin @ TfInterface.pos_quat_to_matrix((*place, 0.0)) @ tip)))


def planar(message: TransformStamped) -> PlanarPose:
    """Projects a transform onto the floor: returns its x, y and yaw."""
    place, quat = TfInterface.msg_to_pos_quat(message)
    return PlanarPose(float(place[0]), float(place[1]), yaw_of(quat))
