"""Opens the services, command topics, trajectory action and URDF parameter of each body.

`SamplePublishers` opens the topics of samples, and `Inputs` the topics of inputs.
"""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import wait
from contextlib import ExitStack
from typing import Any

from cob_srvs.srv import SetString
from control_msgs.srv import QueryTrajectoryState
from custom_srvs.srv import SetTransform, SetTransformRequest
from std_srvs.srv import Empty, Trigger
from trajectory_msgs.msg import JointTrajectory

from custom_ros_tools.errors import InterfaceError
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import (
    CalculateInverseKinematics,
    ResetEffState,
    ResetJointState,
    RobotInfo,
    SetJointState,
    SetMotorGains,
    SwitchControllers,
)
from rpbi.bodies import Body
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.robot import Robot
from rpbi.engine.inputs import PoseInput, check_pose
from rpbi.geometry import Pose
from rpbi.ros.endpoints import Answer, Service, Topic, of, serve, subscribe
from rpbi.ros.publishers.sample_topics import CONTROLLER
from rpbi.ros.requests import BodyContext, Requests
from rpbi.ros.simulation import Simulation
from rpbi.sensors.filters import Zeroing

from .robot_control import (
    controllers,
    move_to_eff_state,
    move_to_init_joint_state,
    move_to_initial_joint_state,
    move_to_joint_state,
    robots_with_controllers,
    set_control_mode,
    set_gains,
    set_joint_state,
    set_motor_gains,
    set_target,
    stop_motion,
    switch_controllers,
)
from .robot_ik import inverse_kinematics, move_by_ik, moved_by_ik
from .robot_info import publish_description, robot_info
from .trajectory_action import open_trajectory_action
from .trajectory_commands import follow_command, followers, query_state

SAMPLES = 100
"""Number of force-torque samples whose mean becomes the new zero."""
LOOK_AGAIN_AFTER_S = 0.2
"""Period [s], in wall time, of checks whether the sensor still takes samples."""
LONGEST_ZEROING_S = 60.0
"""Longest wait [s], in wall time, for all samples; beyond it, zeroing fails and the old zero stays."""


def set_pose(context: BodyContext, request: SetTransformRequest) -> Answer:
    """Moves the base link's URDF frame to a pose in the world frame, even into other bodies, and stops the base.

    Raises:
        ValueError: If the pose is not finite, or the body follows a TF frame.
    """
    position, quat = request.transform.translation, request.transform.rotation
    pose = check_pose(Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w)))
    for taken in context.body.inputs().values():
        if isinstance(taken, PoseInput):
            raise ValueError(f"'{context.name}' follows the TF frame '{taken.tf_id}': move that")
    context.act("teleport", pose)
    return Answer(True, f"'{context.name}' was put there")


def force_torque_sensors(body: Body) -> list[str]:
    """Returns the names of the force-torque sensors of a body, as `BODY/JOINT`."""
    return [sensor.name for sensor in body.force_torque_sensors] if isinstance(body, JointedBody) else []


def zero_force_torque(context: BodyContext, _: Any) -> tuple[()]:
    """Sets the zero of a force-torque sensor to the mean of the sensor's next 100 samples.

    Raises:
        InterfaceError: If the simulation is stopped, the sensor is off, the robot is removed, or the samples take more
            than a minute. The sensor then keeps its old zero.
    """
    body = context.body
    sensor = next(each for each in body.force_torque_sensors if each.name == context.owner)

    def refuse_if_off() -> None:
        if not sensor.hz:
            sensor.cancel_zeroing()
            raise InterfaceError("the sensor is off, so there are no samples to average; the old zero stays")

    def start() -> Zeroing:
        if not context.simulation.running:
            raise InterfaceError("the simulation is stopped: start it to get samples to average")
        refuse_if_off()
        zeroing: Zeroing = sensor.zero(SAMPLES)
        return zeroing

    def check() -> None:
        if not context.simulation.running and not zeroing.mean.done():
            sensor.cancel_zeroing()
            raise InterfaceError(f"the simulation was stopped before {SAMPLES} samples had come; the old zero stays")
        refuse_if_off()
        if time.monotonic() > end_s and not zeroing.mean.done():
            sensor.cancel_zeroing()
            at_rate = f"the sensor has {sensor.hz:g} Hz in the world's time"
            raise InterfaceError(f"not {SAMPLES} samples within {LONGEST_ZEROING_S:g} s: {at_rate}; the old zero stays")

    end_s = time.monotonic() + LONGEST_ZEROING_S
    zeroing = context.ask_body(start, body)
    while not wait([zeroing.mean], timeout=LOOK_AGAIN_AFTER_S).done:
        context.ask_body(check, body)
    return ()


BODY_SERVICES = (
    Service("rpbi/{name}/set_pose", SetTransform, set_pose),
    Service("rpbi/{name}/robot_info", RobotInfo, robot_info, of(JointedBody)),
    Service("rpbi/{name}/ik", CalculateInverseKinematics, inverse_kinematics, of(JointedBody)),
    Service("rpbi/{name}/set_joint_state", SetJointState, set_joint_state, of(JointedBody)),
    Service("rpbi/{name}/ft_sensor", Empty, zero_force_torque, force_torque_sensors),
    Service("rpbi/{name}/set_control_mode", SetString, set_control_mode, of(Robot)),
    Service("rpbi/{name}/set_motor_gains", SetMotorGains, set_motor_gains, of(Robot)),
    Service("rpbi/{name}/switch_controllers", SwitchControllers, switch_controllers, robots_with_controllers),
    Service("rpbi/{name}/set_gains", SetString, set_gains, controllers),
    Service("rpbi/{name}/set_target", SetJointState, set_target, of(Robot)),
    Service("rpbi/{name}/stop_motion", Trigger, stop_motion, of(Robot)),
    Service("rpbi/{name}/move_to_joint_state", ResetJointState, move_to_joint_state, of(Robot)),
    Service("rpbi/{name}/move_to_initial_joint_state", ResetJointState, move_to_initial_joint_state, of(Robot)),
    Service("rpbi/{name}/move_to_init_joint_state", ResetJointState, move_to_init_joint_state, of(Robot)),
    Service("rpbi/{name}/move_to_eff_state", ResetEffState, move_to_eff_state, of(Robot)),
    Service(f"rpbi/{{name}}/{CONTROLLER}/query_state", QueryTrajectoryState, query_state, followers),
)
BODY_TOPICS = (
    Topic(
        "rpbi/{name}/ik",
        CalculateInverseKinematicsProblem,
        move_by_ik,
        "The robot goes to the solution of the problem; with `start_ik_callback`.",
        owners=moved_by_ik,
    ),
    Topic(
        f"rpbi/{{name}}/{CONTROLLER}/command",
        JointTrajectory,
        follow_command,
        "The robot follows the trajectory, without tolerances.",
        owners=followers,
    ),
)
BODY_PARTS: tuple[Callable[[BodyContext], Callable[[], None] | None], ...] = (
    publish_description,
    open_trajectory_action,
)
"""Functions that open a further ROS interface of a body and return the function that closes it.

They return None if the body does not have the interface."""


class BodyEndpoints:
    """Opens and closes the services, topics and other ROS interfaces of bodies."""

    def __init__(self, simulation: Simulation, ask: Requests) -> None:
        self._simulation, self._ask = simulation, ask
        self._open: dict[str, ExitStack] = {}

    def open(self, body: Body) -> None:
        """Opens all ROS interfaces of a body; if one cannot be opened, closes those that were opened before."""

        def contexts(owners: Sequence[str]) -> list[BodyContext]:
            return [BodyContext(body.name, owner, self._simulation, self._ask) for owner in owners]

        with ExitStack() as stack:
            (context,) = contexts([body.name])
            for part in BODY_PARTS:
                close = part(context)
                if close is not None:
                    stack.callback(close)
            for topic in BODY_TOPICS:
                for context in contexts(topic.owners(body)):
                    stack.callback(subscribe(topic, context, context.owner).unregister)
            for service in BODY_SERVICES:
                for context in contexts(service.owners(body)):
                    stack.callback(serve(service, context, context.owner).shutdown, "its body has gone")
            self._open[body.name] = stack.pop_all()

    def close(self, name: str) -> None:
        """Closes all interfaces of the body with a given name."""
        stack = self._open.pop(name, None)
        if stack is not None:
            stack.close()
