"""The services of each body: a table, and how they are opened and closed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import rospy
from std_srvs.srv import Empty, Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.srv import SetString, SetTransform
from ros_pybullet_interface.srv import (
    CalculateInverseKinematics,
    ResetEffState,
    ResetJointState,
    RobotInfo,
    SetJointState,
)

from ..bodies import Body, Robot
from ..bodies.jointed import JointedBody
from .body_context import BodyContext
from .force_torque_zero import force_torque_suffixes, zero_force_torque
from .robot_ik import inverse_kinematics
from .robot_info import robot_info
from .robot_motion import move_to_eff_state, move_to_initial_joint_state, move_to_joint_state
from .robot_switches import set_control_mode, set_joint_state, stop_motion
from .set_pose import set_pose
from .trajectory_commands import query_state, query_suffixes
from .trajectory_messages import QueryTrajectoryState


class BodyService(NamedTuple):
    """A service that bodies of some types have.

    Attributes:
        service_type: Its ROS type.
        answer: Returns the response to a request. What it raises for a request that must be refused (InterfaceError or
            ValueError) becomes `success=False` and its message, or an error of the call where the response has none.
        suffixes: What follows `rpbi/NAME/` in its names, for a body; nothing if the body does not have it.
        meaning: What it does, in a sentence.
    """

    service_type: type
    answer: Callable[[BodyContext, Any], Any]
    suffixes: Callable[[Body], Sequence[str]]
    meaning: str


def of(body_type: type[Body], suffix: str) -> Callable[[Body], Sequence[str]]:
    """Returns the suffixes of a service that every body of a type has once."""
    return lambda body: (suffix,) if isinstance(body, body_type) else ()


BODY_SERVICES: tuple[BodyService, ...] = (
    BodyService(SetTransform, set_pose, of(Body, "set_pose"), "Puts the base link at a pose in the world, at rest."),
    BodyService(
        RobotInfo,
        robot_info,
        of(JointedBody, "robot_info"),
        "Tells joints, limits, force-torque sensors and the present joint state.",
    ),
    BodyService(
        CalculateInverseKinematics,
        inverse_kinematics,
        of(JointedBody, "ik"),
        "Tells joint positions that bring a link to a pose; moves nothing.",
    ),
    BodyService(
        SetJointState,
        set_joint_state,
        of(JointedBody, "set_joint_state"),
        "Puts the joints that are named somewhere at once, within their limits.",
    ),
    BodyService(
        Empty,
        zero_force_torque,
        force_torque_suffixes,
        "Takes the mean of the next 100 samples of that force-torque sensor for zero.",
    ),
    BodyService(
        SetString,
        set_control_mode,
        of(Robot, "set_control_mode"),
        "Switches to `POSITION_CONTROL`, `VELOCITY_CONTROL` or `TORQUE_CONTROL`.",
    ),
    BodyService(Trigger, stop_motion, of(Robot, "stop_motion"), "Ends a timed motion."),
    BodyService(
        ResetJointState,
        move_to_joint_state,
        of(Robot, "move_to_joint_state"),
        "Moves the joints that are named, in `duration` [s]; answers at the end.",
    ),
    BodyService(
        ResetJointState,
        move_to_initial_joint_state,
        of(Robot, "move_to_initial_joint_state"),
        "Moves all joints to where they started, in `duration` [s]; answers at the end.",
    ),
    BodyService(
        ResetEffState,
        move_to_eff_state,
        of(Robot, "move_to_eff_state"),
        "Moves a link to a pose by inverse kinematics, in `duration` [s]; answers at the end.",
    ),
    BodyService(
        QueryTrajectoryState,
        query_state,
        query_suffixes,
        "Tells where joints will be at a time; only with control_msgs.",
    ),
)


def open_service(service: BodyService, context: BodyContext) -> rospy.Service:
    """Opens one service of a body."""
    response_type = service.service_type._response_class

    def handle(request: Any) -> Any:
        try:
            return service.answer(context, request)
        except (InterfaceError, ValueError) as error:
            if "success" in response_type.__slots__:
                return response_type(success=False, message=str(error))
            raise rospy.ServiceException(str(error)) from error

    return rospy.Service(f"rpbi/{context.body.name}/{context.suffix}", service.service_type, handle)
