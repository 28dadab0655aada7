"""Actions on bodies, such as teleporting a body or moving joints. Actions are recorded, and a replay repeats them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from rpbi.config.pybullet_args import CONTROL_MODES
from rpbi.control.controllers.manager import ControllerSwitch, ControllerUpdate
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.control.joint_command import JointCommand
from rpbi.control.motion import Motion
from rpbi.control.motors import MotorGains
from rpbi.control.timed_motion import TimedMotion
from rpbi.control.trajectories.request import GoalTolerances, TrajectoryRequest
from rpbi.engine.clock import Clock
from rpbi.geometry import Pose
from rpbi.plain_values import as_tuple


class TimedGoal(NamedTuple):
    """Target positions of joints, and the duration of the motion.

    Attributes:
        positions: Positions [rad or m], all indexed by joint name, or all by PyBullet's joint index.
        duration_s: Duration of the motion [s].
    """

    positions: Mapping[Any, float]
    duration_s: float


class RecordedTrajectory(NamedTuple):
    """Record of a requested trajectory.

    Attributes:
        request: The trajectory. The trajectory's stamp [ns] is relative to the stamp of the tick at which the
            trajectory was requested; 0 means an immediate start.
        tolerances: Goal tolerances; None if the trajectory was requested without goal tolerances.
    """

    request: TrajectoryRequest
    tolerances: GoalTolerances | None = None

    @classmethod
    def of(cls, request: TrajectoryRequest, tolerances: GoalTolerances | None, clock: Clock) -> RecordedTrajectory:
        """Returns the record of a trajectory that is requested at the clock's present tick."""
        offset_ns = request.stamp_ns - clock.stamp_ns if request.stamp_ns else 0
        return cls(request._replace(stamp_ns=offset_ns), tolerances)


def _stop_motion(body: Any, _: Clock, reason: str) -> bool:
    was_moving = body.drive.motion is not None
    body.halt(reason)
    return was_moving


def _move(body: Any, _: Clock, goal: TimedGoal) -> Motion:
    positions: Any = goal.positions
    if any(isinstance(joint, str) for joint in positions):
        positions = body.model.resolve_driven(tuple(positions), tuple(positions.values()))
    motion = TimedMotion(body.model, positions, goal.duration_s)
    body.drive.run(motion)
    return motion


def _follow(body: Any, clock: Clock, recorded: RecordedTrajectory) -> Motion:
    request, tolerances = recorded
    if request.stamp_ns:
        request = request._replace(stamp_ns=clock.stamp_ns + request.stamp_ns)
    motion: Motion = body.follower.follow(body.follower.check(request, tolerances), clock)
    return motion


class Action(NamedTuple):
    """A kind of action on bodies.

    Attributes:
        do: Function that applies the action, with three arguments: the body, the world's clock and the value.
        value: Function that converts the caller's value to the type that `do` requires, for instance a mapping to a
            named tuple. Raises ValueError if the value cannot be converted.
    """

    do: Callable[[Any, Clock, Any], Any]
    value: Callable[[Any], Any]


def _tuple_of(kind: type) -> Callable[[Any], Any]:
    return partial(as_tuple, kind)


ACTIONS: dict[str, Action] = {
    "teleport": Action(lambda body, _, pose: body.teleport(pose), _tuple_of(Pose)),
    "set_joint_state": Action(
        lambda body, _, target: body.set_joint_state(target), partial(JointCommand.of, quantity="position")
    ),
    "switch_mode": Action(lambda body, _, mode: body.switch_mode(mode), CONTROL_MODES.parse),
    "switch_controllers": Action(lambda body, _, switch: body.switch_controllers(switch), _tuple_of(ControllerSwitch)),
    "set_controller_gains": Action(
        lambda body, _, gains: body.controllers.configure(gains), _tuple_of(ControllerUpdate)
    ),
    "set_gains": Action(lambda body, _, gains: body.motors.set_gains(gains), _tuple_of(MotorGains)),
    "stop_motion": Action(_stop_motion, str),
    "move": Action(_move, _tuple_of(TimedGoal)),
    "follow": Action(_follow, _tuple_of(RecordedTrajectory)),
    "push": Action(lambda body, _, wrench: body.push(wrench), _tuple_of(ExternalWrench)),
    "cancel": Action(lambda body, clock, reason: body.follower.cancel(reason, clock), str),
}
"""Actions on bodies, indexed by name."""
MOVES_AT_ONCE = ("teleport", "set_joint_state")
"""Names of the actions that move a body instantly; they are refused for attached bodies."""
