"""Problems and solutions of inverse kinematics, the same for every solver."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from robot_model.geometry import Pose, Vector, normalized
from robot_model.limits import MAX_MAGNITUDE

JointPositions = Mapping[str, float]
"""Positions by joint [rad or m]."""


@dataclass(frozen=True)
class Waypoint:
    """A pose that a link passes at a time.

    Attributes:
        time_s: Time from the start [s].
        pose: The link's pose in the solver's base frame; positions [m], unit quaternion x, y, z, w.
    """

    time_s: float
    pose: Pose


@dataclass(frozen=True)
class AttachedFrame:
    """A frame of a scene.

    Attributes:
        parent: The link or frame that it is attached to; empty for the root.
        pose: Its pose there; position [m], unit quaternion x, y, z, w.
    """

    parent: str
    pose: Pose


@dataclass(frozen=True)
class IKProblem:
    """A problem for a solver; fields that the solver does not need stay empty.

    Attributes:
        target: Pose of the solver's link in its base frame; quaternions of any length but 0.
        position_tolerance: Largest error along each axis of the target, both ways [m].
        rotation_tolerance: Largest rotation about each axis, both ways [rad]; from pi on, any rotation is accepted.
        start: Start of the search, by joint [rad or m]; joints that are left out start at the middle of their limits.
            Positions outside limits are brought within them, with a warning.
        previous: Previous solutions, newest last; solvers that can stay near them.
        goals: Values of the goals of tasks by the name of the task, for solvers that have tasks.
        waypoints: Waypoints of the link, by time, for solvers of trajectories.
        frames: Frames of the scene by name, for solvers that have a scene; the others stay where they are.
        seed: Seed of everything random: a deterministic solver returns equal answers for equal problems.

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
    frames: Mapping[str, AttachedFrame] = field(default_factory=dict)
    seed: int = 0

    def __post_init__(self) -> None:
        if self.target is not None:
            object.__setattr__(self, "target", _pose("target", self.target))
        waypoints = tuple(
            Waypoint(_number(f"waypoints[{i}].time_s", one.time_s), _pose(f"waypoints[{i}]", one.pose))
            for i, one in enumerate(self.waypoints)
        )
        object.__setattr__(self, "waypoints", waypoints)
        frames = {
            name: AttachedFrame(frame.parent, _pose(f"frames: {name}", frame.pose))
            for name, frame in self.frames.items()
        }
        object.__setattr__(self, "frames", frames)
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
    if not abs(value) <= MAX_MAGNITUDE:
        raise ValueError(f"{what}: expected finite numbers, {MAX_MAGNITUDE:g} at most; got {value:g}")
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
    """Result of a solver.

    Attributes:
        success: Whether all requirements are met within the tolerances, and the limits are kept.
        message: Description of the result, in words with numbers.
        joint_names: The solver's n joints, always in the same order.
        positions: n positions within limits [rad or m]; without success the best that were found, or else the start of
            the search.
        position_error_m: Distance of the link from its target beyond the tolerance [m]; for several, the largest.
        orientation_error_rad: Rotation from the target beyond the tolerance [rad]; for several, the largest.
        alternatives: Other solutions, the best first, if the solver searches several; n positions each.
        trajectory: Trajectory, from solvers of trajectories; `positions` are then its last ones.
        base_pose: Pose of a floating root in the solver's base frame; None for a fixed one.
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
