"""Services that control a robot: motions, targets, control mode, gains and controllers."""

from collections.abc import Mapping
from typing import Any

from cob_srvs.srv import SetStringRequest

from custom_ros_tools.config import load_configs
from custom_ros_tools.errors import ConfigError, InterfaceError
from ros_pybullet_interface.srv import (
    ResetEffStateRequest,
    ResetJointStateRequest,
    SetJointStateRequest,
    SetMotorGainsRequest,
    SwitchControllersRequest,
)
from rpbi.bodies import Body
from rpbi.bodies.robots.robot import Robot
from rpbi.config.pybullet_args import CONTROL_MODES
from rpbi.control.controllers.manager import ControllerSwitch, ControllerUpdate
from rpbi.control.joint_command import JointCommand
from rpbi.control.motion import Motion, MotionResult
from rpbi.control.motors import MODE_NAMES, MotorGains
from rpbi.ros.endpoints import MAX_BYTES, Answer
from rpbi.ros.requests import BodyContext
from rpbi.world.actions import TimedGoal

from .robot_ik import arrival, solve_for_robot


def move_to_joint_state(context: BodyContext, request: ResetJointStateRequest) -> Answer:
    """Moves the named joints to positions in `duration` [s], and answers at the end of the motion.

    A joint whose target is beyond its limits stops at the limit, and `success` is false.
    """
    state = request.joint_state
    target = JointCommand(state.name, state.position, state.velocity, state.effort)
    positions = target.values_of("position", "the goal of a motion is a position")
    return Answer(*_move(context, context.body.model.resolve_driven(target.names, positions), request.duration))


def move_to_initial_joint_state(context: BodyContext, request: ResetJointStateRequest) -> Answer:
    """Moves all joints to their start positions in `duration` [s], and answers at the end of the motion.

    The joint state in the request is ignored.
    """
    return Answer(*_move(context, context.body.start_positions(), request.duration))


def move_to_init_joint_state(context: BodyContext, request: ResetJointStateRequest) -> Answer:
    """Does the same as `move_to_initial_joint_state`; the original ros_pybullet_interface documents this name."""
    return move_to_initial_joint_state(context, request)


def move_to_eff_state(context: BodyContext, request: ResetEffStateRequest) -> Answer:
    """Moves a link to a pose by inverse kinematics in `duration` [s], and answers at the end of the motion.

    Without a solution, the robot does not move.
    """
    solution = solve_for_robot(context, request.problem)
    if not solution.success:
        return Answer(False, f"nothing moved: {solution.message}")
    goal = context.body.model.resolve(solution.chain, solution.chain_positions)
    result = _move(context, goal, request.duration)
    if not result.success:
        return Answer(False, result.message)
    is_near, distance = arrival(context, request.problem)
    return Answer(is_near, f"{result.message}; {distance}")


def set_control_mode(context: BodyContext, request: SetStringRequest) -> Answer:
    """Switches the motors to `POSITION_CONTROL`, `VELOCITY_CONTROL`, `TORQUE_CONTROL` or `IMPEDANCE_CONTROL`.

    An empty text keeps the mode; the answer's message is then the present mode.

    Raises:
        ValueError: If the text is neither empty nor one of these modes.
    """
    before = MODE_NAMES[context.body.motors.mode]
    if not request.data:
        return Answer(True, before)
    mode = CONTROL_MODES.parse(request.data)
    context.act("switch_mode", mode)
    return Answer(True, f"{MODE_NAMES[mode]}, was {before}")


def stop_motion(context: BodyContext, _: Any) -> Answer:
    """Ends the running timed motion.

    The joints then hold their present positions.
    """
    was_moving = context.act("stop_motion", "it was stopped")
    return Answer(was_moving, "stopped" if was_moving else "no motion is running")


def set_motor_gains(context: BodyContext, request: SetMotorGainsRequest) -> Answer:
    """Changes the position and velocity gains of the named joints.

    Raises:
        UnknownNameError: If the robot lacks one of the joints.
        ValueError: If the request has no gains, the lengths of its lists differ, or a gain is negative or not finite.
    """
    context.act("set_gains", MotorGains(request.name, request.position_gains, request.velocity_gains))
    return Answer(True, f"changed gains of {', '.join(request.name)}")


def set_joint_state(context: BodyContext, request: SetJointStateRequest) -> Answer:
    """Sets positions and velocities of the named joints at once; without velocities in the request, sets them to 0.

    Raises:
        UnknownNameError: If the robot lacks one of the joints.
        ValueError: If a number is missing, not finite or outside the joint's limits.
    """
    state = request.joint_state
    if not state.name:
        raise ValueError("expected one joint or more, got none")
    target = JointCommand(state.name, state.position, state.velocity)
    context.act("set_joint_state", target)
    return Answer(True, f"{', '.join(state.name)} put there")


def set_target(context: BodyContext, request: SetJointStateRequest) -> Answer:
    """Sets joint targets as the topic `joint_states/target` does; the next tick after the answer uses the targets.

    Clients that step the world need this service: a message on the topic could arrive after the next step.

    Raises:
        ValueError: If a target is refused; the error has the reason.
    """
    state = request.joint_state
    target = JointCommand(state.name, state.position, state.velocity, state.effort, state.header.stamp.to_nsec())
    context.ask_body(lambda: context.world.put(f"{context.name}/target", target))
    return Answer(True, f"{', '.join(state.name)}: targets set")


def robots_with_controllers(body: Body) -> list[str]:
    """Returns a list with the body's name if the body is a robot with controllers, otherwise an empty list."""
    return [body.name] if isinstance(body, Robot) and body.config.controllers else []


def controllers(body: Body) -> list[str]:
    """Returns the names of a body's controllers, as `BODY/CONTROLLER`."""
    return [f"{body.name}/{name}" for name in body.config.controllers] if isinstance(body, Robot) else []


def switch_controllers(context: BodyContext, request: SwitchControllersRequest) -> Answer:
    """Stops and starts controllers of the robot at the same tick.

    Joints that are no longer driven by a controller hold their present positions.

    Raises:
        UnknownNameError: If the robot lacks one of the controllers.
        ValueError: If two controllers would drive the same joint; all controllers then stay as they were.
    """
    switch = ControllerSwitch(tuple(request.start), tuple(request.stop))
    if not (switch.start or switch.stop):
        raise ValueError("expected controllers to start or to stop, got none")
    context.act("switch_controllers", switch)
    parts = ((switch.stop, "stopped"), (switch.start, "started"))
    return Answer(True, "; ".join(f"{what}: {', '.join(names)}" for names, what in parts if names))


def set_gains(context: BodyContext, request: SetStringRequest) -> Answer:
    """Changes keys of a controller, such as `{stiffness: 200}`; the controller's other keys stay the same.

    An active controller starts again from the robot's present state.

    Raises:
        ConfigError: If the text is not a YAML mapping.
        ValueError: If a key cannot be changed or a value is invalid.
    """
    name = context.owner.split("/", 1)[1]
    changes = load_configs(request.data, "data", MAX_BYTES)
    if not changes:
        raise ValueError("data: expected a mapping such as '{stiffness: 200}', got nothing")
    fixed = changes.keys() & {"type", "active", "joints", "state_hz"}
    if fixed:
        raise ValueError(f"cannot be changed while it runs: {', '.join(sorted(fixed))}")
    config = context.body.controllers.config(name)
    try:
        changed = type(config).parse({**config.model_dump(exclude_unset=True), **changes}, context.owner)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    context.act("set_controller_gains", ControllerUpdate(name, changed))
    return Answer(True, f"changed: {', '.join(map(str, changes))}")


def _move(context: BodyContext, goal: Mapping[int, float], duration_s: float) -> MotionResult:
    """Moves joints to goal positions, waits for the end of the motion and returns its result.

    Args:
        context: Context of the robot.
        goal: Goal positions [rad or m], keyed by joint index.
        duration_s: Duration of the motion [s].

    Raises:
        InterfaceError: If the simulation is stopped, has ended or makes no progress.
        ValueError: If the goal or the duration is refused; the robot does not move then.
    """

    def start() -> Motion:
        if not context.simulation.running:
            raise InterfaceError("nothing moved: the simulation is stopped; call rpbi/start first")
        motion: Motion = context.world.act(context.name, "move", TimedGoal(goal, duration_s))
        return motion

    return context.ask.wait_for(context.ask_body(start).result)
