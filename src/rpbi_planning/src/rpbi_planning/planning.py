"""The function `plan`: from a start to a goal, in one call."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from custom_ros_tools.errors import UnknownNameError

from .certify import certified
from .collision import CollisionModel, collision_model
from .constraints import BoundConstraint, PathConstraint
from .goals import PlanningGoal
from .group import Group
from .planner import PlanningProblem, length
from .planners import PLANNERS
from .reasons import meetings_of, near_at_start, outside_limits, violated_constraint, way_out
from .scene import PlanningScene
from .shortening import shortened
from .timing import PathTiming, PlannedTrajectory, TimingLimits

if TYPE_CHECKING:
    from rpbi.world import World

    from .foresee import Foreseen

Array = np.ndarray
MAX_GROUP = 40
"""Largest number of joints that are planned for at once."""
MAX_GOALS = 12
"""Largest number of configurations of a goal that planners try to reach."""
RESERVE = 0.97, 0.95, 0.9
"""Shares of the limits of velocity, acceleration and jerk that are used. The guard brakes in steps of its period, and
passes the limits a little when a motion uses them fully."""
LESS_M = 3e-4
"""A pair that is nearer than the padding at the start may come nearer by at most this distance [m]."""


@dataclass(frozen=True)
class PlanResult:
    """Result of `plan`.

    Attributes:
        success: Whether a motion was found, proven, timed and certified.
        message: Description of the result, or reason why there is none.
        joint_names: Names of the n joints that move; with several robots, `robot/joint`.
        path: Waypoints, m x n [rad or m]; empty without success.
        trajectory: The timed motion; None without success.
        planner: Name of the planner that found the path; `straight` if the straight motion to the goal is free.
        times_s: Time of each step: goals, planning, shortening, timing, checking, foreseeing [s].
        foreseen: Effects of the motion in a fork of the world; None if they were not asked for.
        processor_s: Processor time of each step [s], which is less than `times_s` on a busy computer.
    """

    success: bool
    message: str
    joint_names: tuple[str, ...]
    path: Array
    trajectory: PlannedTrajectory | None = None
    planner: str = ""
    times_s: Mapping[str, float] = field(default_factory=dict)
    foreseen: Foreseen | None = None
    processor_s: Mapping[str, float] = field(default_factory=dict)


class _Clock:
    def __init__(self) -> None:
        self.times_s, self.processor_s = dict[str, float](), dict[str, float]()
        self._last = time.perf_counter(), time.thread_time()

    def note(self, step: str) -> None:
        now = time.perf_counter(), time.thread_time()
        self.times_s[step], self.processor_s[step] = (b - a for a, b in zip(self._last, now))
        self._last = now


def plan(
    scene: PlanningScene,
    robot: str | Sequence[str],
    goal: PlanningGoal | Mapping[str, PlanningGoal],
    *,
    start: Mapping[str, float] | Sequence[float] | None = None,
    group: Sequence[str] | None = None,
    constraints: Sequence[PathConstraint] = (),
    planner: str = "rrt_connect",
    options: Mapping[str, Any] | None = None,
    time_limit_s: float = 5.0,
    shorten_s: float = 0.3,
    speed: float = 1.0,
    seed: int = 0,
    certify: bool = True,
    foresee: World | None = None,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> PlanResult:
    """Plans a motion of a robot, or of several robots together, to a goal.

    The path is searched among motions that are proven free, shortened, timed within the limits of velocity,
    acceleration and jerk, proven again as a timed motion, and passed through the guard's checks.

    Args:
        scene: Robots and bodies.
        robot: Name of the robot, or names of several robots.
        goal: The goal; with several robots, a goal for each robot that has to reach one.
        start: Start of the robot; None for its positions in the scene. With several robots, it has to be None.
        group: Names of the joints that may move; None for all driven joints.
        constraints: Constraints that the first robot keeps on the whole path.
        planner: Name of the planner in `PLANNERS`, or `module:Class`.
        options: Options of the planner.
        time_limit_s: Longest time for goals and path [s]; the model of a new scene is made before.
        shorten_s: Longest time for shortening [s].
        speed: Factor of the velocities; the duration is divided by it.
        seed: Seed of random numbers.
        certify: Whether the motion is passed through the guard's checks.
        foresee: A world in whose fork the motion is simulated; the world itself does not change.
        is_cancelled: Function that is called often; the plan ends when it returns true.

    Raises:
        UnknownNameError: If a robot, joint, link, posture or planner is unknown.
        ValueError: If a number is not finite or out of range, constraints contradict each other at the start, or the
            request is invalid in another respect.
        ConfigError: If a mesh cannot be read, or options are invalid.
        InterfaceError: If the scene has no robot.
        MissingDependency: If the extra `planning` is not installed.
    """
    for key, value, least in (("time_limit_s", time_limit_s, 0.0), ("shorten_s", shorten_s, -1e-12)):
        if not (math.isfinite(value) and value > least):
            raise ValueError(f"{key}: expected a positive number of seconds, got {value}")
    if not 0.0 < speed <= 1.0:
        raise ValueError(f"speed: expected a factor above 0, at most 1, got {speed}")
    names = [robot] if isinstance(robot, str) else list(robot)
    if not names:
        raise ValueError("robot: expected at least one name, got none")
    kind = PLANNERS.find(planner)
    searching = kind(kind.Config.parse(dict(options or {}), "~"))
    members = [scene.robot(name) for name in names]
    full = [each.positions for each in members]
    if start is not None:
        if len(members) > 1:
            raise ValueError("start: with several robots, use scene.set_positions for each of them")
        full = [members[0].vector(start)]
    joints = Group(scene, names, group)
    if (n := len(joints.joint_names)) > MAX_GROUP:
        raise ValueError(f"group: expected at most {MAX_GROUP} joints, got {n}: name those that may move")
    kept = [member.positions for member in members]
    try:
        for member, positions in zip(members, full):
            member.positions = positions
        return _Plan(scene, joints, searching, seed, is_cancelled).run(
            full, goal, constraints, planner, time_limit_s, shorten_s, speed, certify, foresee
        )
    finally:
        for member, positions in zip(members, kept):
            member.positions = positions


class _Plan:
    def __init__(
        self, scene: PlanningScene, group: Group, searching: Any, seed: int, is_cancelled: Callable[[], bool]
    ) -> None:
        self._scene, self._group, self._searching = scene, group, searching
        self._seed, self._is_cancelled = seed, is_cancelled
        self._clock = _Clock()

    def run(
        self,
        full: Sequence[Array],
        goal: PlanningGoal | Mapping[str, PlanningGoal],
        constraints: Sequence[PathConstraint],
        planner: str,
        time_limit_s: float,
        shorten_s: float,
        speed: float,
        certify: bool,
        foresee: World | None,
    ) -> PlanResult:
        group, scene = self._group, self._scene
        bound = [BoundConstraint(each, group) for each in constraints]
        model = collision_model(scene, group, bound)
        start = group.of(full)
        if reason := outside_limits(group, start):
            return self._failed(reason)
        start = np.clip(start, group.lower, group.upper)
        if problem := violated_constraint(bound, start):
            return self._failed(f"the start violates a path constraint: {problem}")
        if reason := self._adapt_to_start(model, start):
            return self._failed(reason)
        self._clock.note("scene")
        until = time.monotonic() + time_limit_s
        goals, reason = self._goals(model, full, start, goal, bound)
        self._clock.note("goals")
        if reason:
            return self._failed(reason)
        path, used = self._path(model, start, goals, bound, planner, until)
        self._clock.note("planning")
        if path is None:
            if self._is_cancelled():
                return self._failed("cancelled")
            return self._failed(
                "no path was found within the time limit: the goal may be enclosed; a longer time limit, another "
                f"planner or less padding may help{near_at_start(model, start)}"
            )
        if shorten_s > 0.0:
            end = time.monotonic() + shorten_s
            connect = self._bridges(model, start, bound, end) if bound else None
            path = shortened(path, model, end, self._seed, self._is_cancelled, connect)
        self._clock.note("shortening")
        scales = (share * speed**power for power, share in enumerate(RESERVE, 1))
        limits = TimingLimits(*(scale * each for scale, each in zip(scales, group.motion_limits)))
        timing = PathTiming(group.joint_names, path, limits)
        trajectory = timing.stop_until(model.first_unproven)
        self._clock.note("timing")
        if (at := model.first_unproven(trajectory)) is not None:
            return self._failed(f"the timed motion is not proven to be free at {at:.3f} s")
        if certify:
            trajectory, reason = certified(scene, group, timing, 0.0 if model.is_lowered else scene.padding_m)
            if reason:
                self._clock.note("checking")
                return self._failed(f"the guard's checks refuse the motion: {reason}")
        self._clock.note("checking")
        if self._is_cancelled():
            return self._failed("cancelled")
        foreseen = None
        if foresee is not None:
            from .foresee import foresee_in

            foreseen = foresee_in(foresee, group, trajectory)
            self._clock.note("foreseeing")
        words = f"{len(path)} waypoints, length {length(path):.2f}, {trajectory.duration_s:.2f} s"
        return PlanResult(
            True,
            words,
            group.joint_names,
            path,
            trajectory,
            used,
            self._clock.times_s,
            foreseen,
            self._clock.processor_s,
        )

    def _bridges(
        self, model: CollisionModel, start: Array, bound: Sequence[BoundConstraint], until: float
    ) -> Callable[[Array, Array], Array | None]:
        from .planners.projected import ProjectedConfig, bridge

        problem = PlanningProblem(model, start, start[None], until, self._seed, self._is_cancelled, bound)
        return lambda first, last: bridge(first, last, problem, ProjectedConfig().step)

    def _failed(self, message: str) -> PlanResult:
        names = self._group.joint_names
        return PlanResult(
            False,
            message,
            names,
            np.empty((0, len(names))),
            times_s=self._clock.times_s,
            processor_s=self._clock.processor_s,
        )

    def _adapt_to_start(self, model: CollisionModel, start: Array) -> str:
        """Lowers the paddings of pairs that are nearer at the start; returns a reason if shapes penetrate there."""
        distances = model.distances(start)
        if (distances < 0.0).any():
            return f"the start is in collision: {way_out(model, start)}"
        model.set_paddings(np.minimum(model.padding, np.maximum(distances - LESS_M, 0.0)))
        return ""

    def _goals(
        self,
        model: CollisionModel,
        full: Sequence[Array],
        start: Array,
        goal: PlanningGoal | Mapping[str, PlanningGoal],
        bound: Sequence[BoundConstraint],
    ) -> tuple[Array, str]:
        """Returns configurations of the goal that are free, the nearest first, or a reason."""
        group, scene = self._group, self._scene
        goals = goal if isinstance(goal, Mapping) else {group.robots[0].name: goal}
        names = [robot.name for robot in group.robots]
        per_robot = []
        for name in goals:
            if name not in names:
                raise UnknownNameError("robot of the plan", name, names)
        for r, robot in enumerate(group.robots):
            if robot.name not in goals:
                per_robot.append(full[r][None])
                continue
            found = goals[robot.name].states(scene, robot, group.columns[r], full[r], self._seed)
            if not len(found.states):
                return np.empty((0, len(start))), found.message
            per_robot.append(found.states)
        states = np.array([group.of(each) for each in _products(per_robot)])
        order = np.argsort(np.linalg.norm(states - start, axis=1))
        free, nearest = [], ""
        for q in states[order]:
            if model.is_free(q):
                free.append(q)
            elif not nearest:
                nearest = violated_constraint(bound, q) or meetings_of(model, q) or "outside the limits"
            if len(free) == MAX_GOALS:
                break
        if not free:
            reason = f"the goal is in collision or violates a constraint in all {len(states)} configurations found"
            return np.empty((0, len(start))), f"{reason}; in the nearest: {nearest}"
        return np.array(free), ""

    def _path(
        self,
        model: CollisionModel,
        start: Array,
        goals: Array,
        bound: Sequence[BoundConstraint],
        planner: str,
        until: float,
    ) -> tuple[Array | None, str]:
        for q in goals:
            if time.monotonic() >= until or self._is_cancelled():
                return None, ""
            if model.edge(start, q):
                return np.array((start, q)), "straight"
        searching = self._searching
        if bound and not searching.keeps_constraints:
            kind = PLANNERS.find("projected")
            searching, planner = kind(kind.Config()), "projected"
        kept = _kept(self._scene, model, bound)
        problem = PlanningProblem(model, start, goals, until, self._seed, self._is_cancelled, bound, kept)
        return searching.search(problem), planner


def _kept(scene: PlanningScene, model: CollisionModel, bound: Sequence[BoundConstraint]) -> dict[str, Any]:
    """Returns what planners keep between plans, as long as nothing but the moving joints has changed."""
    group = model.group
    moving = {robot.name: columns for robot, columns in zip(group.robots, group.columns)}
    still = [np.delete(each.positions, moving.get(name, [])).tolist() for name, each in scene.robots.items()]
    key = (
        scene.version,
        group.joint_names,
        repr(still),
        tuple(scene.poses.items()),
        model.padding.tobytes(),
        repr([bound.constraint for bound in bound]),
    )
    if scene.kept_by_planners[0] != key:
        scene.kept_by_planners = key, {}
    return scene.kept_by_planners[1]


def _products(per_robot: Sequence[Array]) -> list[list[Array]]:
    found: list[list[Array]] = [[]]
    for states in per_robot:
        found = [[*before, state] for before in found for state in states[:MAX_GOALS]]
    return found[: MAX_GOALS**2]
