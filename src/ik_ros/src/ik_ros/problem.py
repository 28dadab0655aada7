"""Problems and solutions of inverse kinematics; all solvers use the same classes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from robot_model.geometry import Pose, Vector, normalized
from robot_model.limits import MAX_MAGNITUDE

JointPositions = Mapping[str, float]
"""Joint positions by joint name [rad or m]."""


@dataclass(frozen=True)
class Waypoint:
    """A pose that a link passes through at a given time.

    Attributes:
        time_s: Time since the start of the motion [s].
        pose: Pose of the link in the solver's base frame.
    """

    time_s: float
    pose: Pose


@dataclass(frozen=True)
class AttachedFrame:
    """A frame of a scene, attached to a link or to another frame.

    Attributes:
        parent: Name of the link or frame that the frame is attached to; empty for the robot's root.
        pose: Pose of the frame in `parent`.
    """

    parent: str
    pose: Pose


@dataclass(frozen=True)
class IKProblem:
    """A problem for a solver. Fields that the solver does not need can stay empty.

    Attributes:
        target: Target pose of the solver's link in the solver's base frame. The quaternion may have any length but 0.
        position_tolerance: Largest allowed error along each axis of the target, in both directions [m].
        rotation_tolerance: Largest allowed rotation about each axis of the target, in both directions [rad]. From pi
            on, every rotation is accepted.
        start: Start positions of the search by joint name [rad or m]. Joints that are left out start at the middle of
            their limits. Positions outside the limits are moved into the limits, with a warning.
        previous: Previous solutions, the newest last, for solvers that use them.
        goals: Values of each task's goal, indexed by task name, for solvers with tasks.
        waypoints: Waypoints of the link, sorted by time, for solvers that find trajectories.
        frames: Frames of the scene to attach to a new parent, indexed by frame name, for solvers with a scene. Other
            frames of the scene keep their parent.
        seed: Seed of the solver's random generator. A deterministic solver returns equal answers for equal problems.

    Raises:
        ValueError: If a number is not finite or out of range; the message names the field.
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
    """Positions and velocities of n joints at m times.

    Attributes:
        times_s: m increasing times since the start [s].
        positions: n positions for each of the m times [rad or m].
        velocities: n velocities for each of the m times [rad/s or m/s].
    """

    times_s: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    velocities: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class IKSolution:
    """Result of a solver.

    Attributes:
        success: Whether all requirements are met within the tolerances, and all joints are within their limits.
        message: Description of the result in words, with numbers.
        joint_names: Names of the solver's n joints, always in the same order.
        positions: n positions within the limits [rad or m]. Without success, the best positions that the solver found,
            or the start of the search.
        position_error_m: Part of the link's position error that exceeds the tolerances [m]. With several links or
            waypoints, the largest of them.
        orientation_error_rad: The same for the orientation error [rad].
        alternatives: Other solutions with n positions each, the best first, from solvers that find several solutions.
        trajectory: The trajectory, from solvers that find trajectories; `positions` are then its last positions.
        base_pose: Pose of a floating root in the solver's base frame; None for a fixed root.
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
