"""Services that move a robot, in a given time or at once, and that change its control mode and gains."""

from collections.abc import Mapping
from typing import Any

from cob_srvs.srv import SetStringRequest

from custom_ros_tools.errors import InterfaceError
from ros_pybullet_interface.srv import (
    ResetEffStateRequest,
    ResetJointStateRequest,
    SetJointStateRequest,
    SetMotorGainsRequest,
)
from rpbi.config.pybullet_args import CONTROL_MODES
from rpbi.control.joint_command import JointCommand
from rpbi.control.motion import Motion, MotionResult
from rpbi.control.motors import MODE_NAMES, MotorGains
from rpbi.ros.endpoints import Answer
from rpbi.ros.requests import BodyContext
from rpbi.world.actions import TimedGoal

from .robot_ik import arrival, solve_for_robot


def move_to_joint_state(context: BodyContext, request: ResetJointStateRequest) -> Answer:
    """Moves the joints that are named, in `duration` [s]; answers at the end.

    Those that are asked to go beyond their limits stop there, and `success` is false.
    """
    state = request.joint_state
    target = JointCommand(state.name, state.position, state.velocity, state.effort)
    positions = target.values_of("position", "the goal of a motion is a position")
    return Answer(*_move(context, context.body.model.resolve_driven(target.names, positions), request.duration))


def move_to_initial_joint_state(context: BodyContext, request: ResetJointStateRequest) -> Answer:
    """Moves all joints to where they started, in `duration` [s]; answers at the end.

    The state in the request is ignored.
    """
    return Answer(*_move(context, context.body.start_positions(), request.duration))


def move_to_init_joint_state(context: BodyContext, request: ResetJointStateRequest) -> Answer:
    """The same as `move_to_initial_joint_state`, by its name in the documentation of the authors' release."""
    return move_to_initial_joint_state(context, request)


def move_to_eff_state(context: BodyContext, request: ResetEffStateRequest) -> Answer:
    """Moves a link to a pose by inverse kinematics, in `duration` [s]; answers at the end.

    Nothing moves if there is no solution.
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
    """Switches to `POSITION_CONTROL`, `VELOCITY_CONTROL`, `TORQUE_CONTROL` or `IMPEDANCE_CONTROL`.

    An empty text switches nothing; the answer is the present mode.

    Raises:
        ValueError: If the text is none of these.
    """
    before = MODE_NAMES[context.body.motors.mode]
    if not request.data:
        return Answer(True, before)
    mode = CONTROL_MODES.parse(request.data)
    context.act("switch_mode", mode)
    return Answer(True, f"{MODE_NAMES[mode]}, was {before}")


def stop_motion(context: BodyContext, _: Any) -> Answer:
    """Ends a timed motion.

    Its joints hold where they are.
    """
    was_moving = context.act("stop_motion", "it was stopped")
    return Answer(was_moving, "stopped" if was_moving else "no motion is running")


def set_motor_gains(context: BodyContext, request: SetMotorGainsRequest) -> Answer:
    """Changes position and velocity gains of the joints that are named.

    Raises:
        UnknownNameError: If the robot lacks one of the joints.
        ValueError: If there is nothing to change, lengths differ or a gain is negative or not finite.
    """
    context.act("set_gains", MotorGains(request.name, request.position_gains, request.velocity_gains))
    return Answer(True, f"changed gains of {', '.join(request.name)}")


def set_joint_state(context: BodyContext, request: SetJointStateRequest) -> Answer:
    """Sets the named joints to positions at once, within their limits.

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
    """Sets targets as the topic `joint_states/target` does; it answers when they count from the next tick on.

    Controllers in lock-step use it, since a message may arrive after the step that is requested next.

    Raises:
        ValueError: If a target is refused, with its reason.
    """
    state = request.joint_state
    target = JointCommand(state.name, state.position, state.velocity, state.effort, state.header.stamp.to_nsec())
    context.ask_body(lambda: context.world.put(f"{context.name}/target", target))
    return Answer(True, f"{', '.join(state.name)}: targets set")


def _move(context: BodyContext, goal: Mapping[int, float], duration_s: float) -> MotionResult:
    """Moves and waits for the end.

    Raises:
        InterfaceError: If the simulation is stopped, has ended or makes no progress.
        ValueError: If the goal or the duration is refused; nothing moves then.
    """

    def start() -> Motion:
        if not context.simulation.running:
            raise InterfaceError("nothing moved: the simulation is stopped; call rpbi/start first")
        motion: Motion = context.world.act(context.name, "move", TimedGoal(goal, duration_s))
        return motion

    return context.ask.wait_for(context.ask_body(start).result)
