"""Questions to inverse kinematics and answers, the same for every solver."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rpbi.geometry import Pose, Vector, normalized
from rpbi.kinematics.problem import LARGEST

JointPositions = Mapping[str, float]
"""Positions by joint [rad or m]."""


@dataclass(frozen=True)
class Waypoint:
    """What a link passes at a time.

    Attributes:
        time_s: When, from the start [s].
        pose: The link's pose in the solver's base frame; positions [m], unit quaternion x, y, z, w.
    """

    time_s: float
    pose: Pose


@dataclass(frozen=True)
class IKProblem:
    """What a solver is asked; what a problem does not need stays empty.

    Attributes:
        target: Pose of the solver's link in its base frame; quaternions of any length but 0.
        position_tolerance: How far off the target the link may be along each axis of the target, both ways [m].
        rotation_tolerance: How far it may be turned about each of them, both ways [rad]; from pi on, as it likes.
        start: Where the search starts, by joint [rad or m]; joints that are left out start at the middle of their
            limits. Positions outside limits are brought in, with a warning.
        previous: Previous solutions, newest last; solvers that can stay near them.
        goals: Values of the goals of tasks by the name of the task, for solvers that have tasks.
        waypoints: What the link passes, by time, for solvers of trajectories.
        seed: Of whatever is random: solvers that are deterministic give equal problems equal answers.

    Raises:
        ValueError: If a number is not finite or out of its range; it names the field.
    """

    target: Pose | None = None
    position_tolerance: Vector = (0.0, 0.0, 0.0)
    rotation_tolerance: Vector = (0.0, 0.0, 0.0)
    start: JointPositions = field(default_factory=dict)
    previous: tuple[JointPositions, ...] = ()
    goals: Mapping[str, Sequence[float]] = field(default_factory=dict)
    waypoints: tuple[Waypoint, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        if self.target is not None:
            object.__setattr__(self, "target", _pose("target", self.target))
        waypoints = tuple(
            Waypoint(_number(f"waypoints[{i}].time_s", one.time_s), _pose(f"waypoints[{i}]", one.pose))
            for i, one in enumerate(self.waypoints)
        )
        object.__setattr__(self, "waypoints", waypoints)
        for name in ("position_tolerance", "rotation_tolerance"):
            values = _numbers(name, getattr(self, name), 3)
            if min(values) < 0.0:
                raise ValueError(f"{name}: must not be negative, got {values}")
            object.__setattr__(self, name, values)
        for joint, position in self.start.items():
            _number(f"start: {joint}", position)
        for i, solution in enumerate(self.previous):
            for joint, position in solution.items():
                _number(f"previous[{i}]: {joint}", position)
        goals = {task: _numbers(f"goals: {task}", values) for task, values in self.goals.items()}
        object.__setattr__(self, "goals", goals)


def _pose(what: str, pose: Pose) -> Pose:
    x, y, z = _numbers(f"{what}: position", pose.position, 3)
    quaternion = _numbers(f"{what}: quaternion", pose.quat_xyzw, 4)
    if math.hypot(*quaternion) < 1e-6:
        raise ValueError(f"{what}: quaternion: must not be zero, got {quaternion}")
    return Pose((x, y, z), normalized(quaternion))


def _numbers(what: str, values: Sequence[float], count: int | None = None) -> tuple[float, ...]:
    if count is not None and len(values) != count:
        raise ValueError(f"{what}: expected {count} values, got {len(values)}")
    return tuple(_number(what, value) for value in values)


def _number(what: str, value: float) -> float:
    value = float(value)
    if not abs(value) <= LARGEST:
        raise ValueError(f"{what}: expected finite numbers, {LARGEST:g} at most; got {value:g}")
    return value


@dataclass(frozen=True)
class SampledTrajectory:
    """Positions of n joints over time.

    Attributes:
        times_s: m times from the start [s], increasing.
        positions: For each of them, n positions [rad or m].
        velocities: For each of them, n velocities [rad/s or m/s].
    """

    times_s: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    velocities: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class IKSolution:
    """Where a solver got to.

    Attributes:
        success: Whether all that was asked for is met within the tolerances, and the limits are held.
        message: How well it went, or why not, in words with numbers.
        joint_names: The solver's n joints, always in the same order.
        positions: n positions within limits [rad or m]; without success, the best that were found, and without any
            of those, where the search started.
        position_error_m: How far the link is off its target beyond the tolerance [m]; for several, the largest.
        orientation_error_rad: How far it is turned beyond the tolerance [rad]; for several, the largest.
        alternatives: Other solutions, the best first, of solvers that look for more than one; n positions each.
        trajectory: Of solvers of trajectories; `positions` are then its last ones.
        base_pose: Of robots whose root floats: where it is then in the solver's base frame.
    """

    success: bool
    message: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]
    position_error_m: float = 0.0
    orientation_error_rad: float = 0.0
    alternatives: tuple[tuple[float, ...], ...] = ()
    trajectory: SampledTrajectory | None = None
    base_pose: Pose | None = None
