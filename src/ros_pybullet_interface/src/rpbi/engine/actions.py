"""What can be done to a body beside its inputs; a replay does the same from the record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rpbi.control.motion import Motion
from rpbi.control.timed_motion import TimedMotion
from rpbi.control.trajectories.request import GoalTolerances, TrajectoryRequest

from .clock import Clock


class TimedGoal(NamedTuple):
    """Where joints are to be, and when.

    Attributes:
        positions: Positions [rad or m] by joint index.
        duration_s: In what time [s].
    """

    positions: Mapping[int, float]
    duration_s: float


class RecordedTrajectory(NamedTuple):
    """A trajectory that a robot was asked to follow.

    Attributes:
        request: The trajectory, its stamp counted from the stamp of the tick [ns]; 0 is at once.
        tolerances: How well it was to be followed, None if that was not looked at.
    """

    request: TrajectoryRequest
    tolerances: GoalTolerances | None

    @classmethod
    def of(cls, request: TrajectoryRequest, tolerances: GoalTolerances | None, clock: Clock) -> RecordedTrajectory:
        """Returns the record of a request at the clock's present tick."""
        offset_ns = request.stamp_ns - clock.stamp_ns if request.stamp_ns else 0
        return cls(request._replace(stamp_ns=offset_ns), tolerances)


def _stop_motion(body: Any, _: Clock, reason: str) -> bool:
    was_moving = body.drive.motion is not None
    body.halt(reason)
    return was_moving


def _move(body: Any, _: Clock, goal: TimedGoal) -> Motion:
    motion = TimedMotion(body.model, goal.positions, goal.duration_s)
    body.drive.run(motion)
    return motion


def _follow(body: Any, clock: Clock, recorded: RecordedTrajectory) -> Motion:
    request, tolerances = recorded
    if request.stamp_ns:
        request = request._replace(stamp_ns=clock.stamp_ns + request.stamp_ns)
    motion: Motion = body.follower.follow(body.follower.check(request, tolerances), clock)
    return motion


ACTIONS: dict[str, Callable[[Any, Clock, Any], Any]] = {
    "teleport": lambda body, _, pose: body.teleport(pose),
    "set_joint_state": lambda body, _, target: body.set_joint_state(target),
    "switch_mode": lambda body, _, mode: body.switch_mode(mode),
    "switch_controllers": lambda body, _, switch: body.switch_controllers(switch),
    "set_controller_gains": lambda body, _, gains: body.controllers.configure(gains),
    "set_gains": lambda body, _, gains: body.motors.set_gains(gains),
    "stop_motion": _stop_motion,
    "move": _move,
    "follow": _follow,
    "push": lambda body, _, wrench: body.push(wrench),
    "cancel": lambda body, clock, reason: body.follower.cancel(reason, clock),
}
"""Each does something to a body, with the world's clock and a value."""
MOVES_AT_ONCE = ("teleport", "set_joint_state")
"""Those that put a body elsewhere, which attachments would pull back."""
