"""The services of each body: a table, and how they are opened and closed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import wait
from typing import Any, NamedTuple

import rospy
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse, Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.srv import SetString, SetTransform, SetTransformRequest, SetTransformResponse
from ros_pybullet_interface.srv import (
    CalculateInverseKinematics,
    ResetEffState,
    ResetJointState,
    RobotInfo,
    SetJointState,
)
from rpbi.bodies import Body
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.robot import Robot
from rpbi.engine.inputs import PoseInput, check_pose
from rpbi.geometry import Pose
from rpbi.ros.robots.ik import inverse_kinematics
from rpbi.ros.robots.info import robot_info
from rpbi.ros.robots.motion import move_to_eff_state, move_to_initial_joint_state, move_to_joint_state
from rpbi.ros.robots.switches import set_control_mode, set_joint_state, stop_motion
from rpbi.ros.robots.trajectory_commands import query_state, query_suffixes
from rpbi.ros.robots.trajectory_messages import QueryTrajectoryState
from rpbi.sensors.filters import Zeroing

from .body_context import BodyContext


def set_pose(context: BodyContext, request: SetTransformRequest) -> SetTransformResponse:
    """Puts the base link's frame at a pose in the world, at rest, whatever is in the way.

    Raises:
        ValueError: If the pose is not finite, or the body follows a TF frame, which would take it back.
    """
    position, quat = request.transform.translation, request.transform.rotation
    pose = check_pose(Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w)))
    body = context.body
    for taken in body.inputs().values():
        if isinstance(taken, PoseInput):
            raise ValueError(f"'{body.name}' follows the TF frame '{taken.tf_id}': move that")
    context.act("teleport", pose)
    return SetTransformResponse(success=True, message=f"'{body.name}' was put there")


SAMPLES = 100
"""How many samples are averaged."""
LOOK_AGAIN_AFTER_S = 0.2
"""How often it is seen whether samples still come [s] of wall time."""
_SUFFIX = "/ft_sensor"


def force_torque_suffixes(body: Body) -> list[str]:
    """Returns what follows `rpbi/NAME/` in the service of each sensor of a body."""
    sensors = body.force_torque_sensors if isinstance(body, JointedBody) else ()
    return [f"{sensor.joint.name}{_SUFFIX}" for sensor in sensors]


def zero_force_torque(context: BodyContext, _: EmptyRequest) -> EmptyResponse:
    """Averages the coming samples and takes the mean for zero; answers when that is done.

    Raises:
        InterfaceError: If the simulation is stopped, before or meanwhile, or the robot goes; the old zero stays then.
    """
    joint = context.suffix.removesuffix(_SUFFIX)
    body = context.body
    sensor = next(each for each in body.force_torque_sensors if each.joint.name == joint)

    def start() -> Zeroing:
        if not context.simulation.running:
            raise InterfaceError("the simulation is stopped: start it, else there are no samples to average")
        zeroing: Zeroing = sensor.zero(SAMPLES)
        return zeroing

    def check() -> None:
        if not context.simulation.running and not zeroing.mean.done():
            sensor.cancel_zeroing()
            raise InterfaceError(f"the simulation was stopped before {SAMPLES} samples had come; the old zero stays")

    zeroing = context.ask_body(start, body)
    while not wait([zeroing.mean], timeout=LOOK_AGAIN_AFTER_S).done:
        context.ask_body(check, body)
    return EmptyResponse()


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
