"""Goals of plans, and the configurations that reach them."""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import UnknownNameError
from ik_ros.problem import IKProblem
from ik_ros.solvers.global_search import GlobalConfig, GlobalSolver
from robot_model.geometry import Pose, Vector
from robot_model.limits import Limits

from .scene import PlanningScene
from .scene_robot import SceneRobot
from .yaml_words import built

Array = np.ndarray
RESTARTS = 30
"""Number of random starts of inverse kinematics for a pose."""
REGION_SAMPLES = 8
"""Number of poses that are drawn from a region."""
FIXED = 1e-9
"""Half the range of joints that do not move while inverse kinematics searches [rad or m]."""


class GoalStates(NamedTuple):
    """Configurations that reach a goal.

    Attributes:
        states: Configurations of all driven joints of the robot, k x m.
        message: Reason why there is none; empty if there are some.
    """

    states: Array
    message: str = ""


class PlanningGoal(ABC):
    """A goal of one robot."""

    @abstractmethod
    def states(
        self, scene: PlanningScene, robot: SceneRobot, moving: Sequence[int], start: Array, seed: int
    ) -> GoalStates:
        """Returns configurations that reach the goal, without regard to collisions.

        Args:
            scene: The scene.
            robot: The robot.
            moving: Indices of the driven joints that may move.
            start: Positions of all driven joints, for those that do not move, and as start of searches.
            seed: Seed of random numbers.

        Raises:
            UnknownNameError: If the goal names an unknown joint, link or posture.
            ValueError: If the goal is invalid.
        """


@dataclass(frozen=True)
class JointGoal(PlanningGoal):
    """Joint positions.

    Attributes:
        positions: Positions by joint name, or of all driven joints [rad or m]. Joints that are left out keep theirs.
    """

    positions: Mapping[str, float] | Sequence[float]

    def states(
        self, scene: PlanningScene, robot: SceneRobot, moving: Sequence[int], start: Array, seed: int
    ) -> GoalStates:
        """See `PlanningGoal`."""
        wanted = robot.vector(self.positions, "goal")
        if isinstance(self.positions, Mapping):
            given = [name in self.positions for name in robot.model.joint_names]
            wanted = np.where(given, wanted, start)
        for i, name in enumerate(robot.model.joint_names):
            if i not in moving and abs(wanted[i] - start[i]) > 1e-6:
                raise ValueError(f"goal: joint '{name}' is not in the group, and cannot move to {wanted[i]:g}")
            low, high = robot.limits.lower[i], robot.limits.upper[i]
            if not low - 1e-6 <= wanted[i] <= high + 1e-6:
                words = f"joint '{name}': {wanted[i]:g} is outside its limits, {low:g} to {high:g}"
                return GoalStates(np.empty((0, len(wanted))), f"the goal cannot be reached: {words}")
        return GoalStates(np.clip(wanted, robot.limits.lower, robot.limits.upper)[None])


@dataclass(frozen=True)
class NamedGoal(PlanningGoal):
    """A posture of `SceneRobot.postures`, such as `start`.

    Attributes:
        name: Name of the posture.
    """

    name: str

    def states(
        self, scene: PlanningScene, robot: SceneRobot, moving: Sequence[int], start: Array, seed: int
    ) -> GoalStates:
        """See `PlanningGoal`."""
        if self.name not in robot.postures:
            raise UnknownNameError("posture", self.name, robot.postures)
        wanted = start.copy()
        wanted[list(moving)] = robot.postures[self.name][list(moving)]
        return JointGoal(wanted.tolist()).states(scene, robot, moving, start, seed)


@dataclass(frozen=True)
class PoseGoal(PlanningGoal):
    """A pose of a link in the world.

    Attributes:
        link: Name of the link.
        pose: The pose.
        position_tolerance: Largest error along each axis of the pose [m].
        orientation_tolerance: Largest rotation about each axis of the pose [rad]; from pi on, any orientation.
    """

    link: str
    pose: Pose
    position_tolerance: float = 0.0
    orientation_tolerance: float = 0.0

    def __post_init__(self) -> None:
        for key in ("position_tolerance", "orientation_tolerance"):
            if not (math.isfinite(getattr(self, key)) and getattr(self, key) >= 0.0):
                raise ValueError(f"{key}: expected a number that is not negative, got {getattr(self, key)}")

    def states(
        self, scene: PlanningScene, robot: SceneRobot, moving: Sequence[int], start: Array, seed: int
    ) -> GoalStates:
        """See `PlanningGoal`."""
        tolerances = (self.position_tolerance,) * 3, (self.orientation_tolerance,) * 3
        return _solved(robot, self.link, [self.pose], *tolerances, moving, start, seed)


@dataclass(frozen=True)
class RegionGoal(PlanningGoal):
    """A box in which the origin of a link has to be.

    Attributes:
        link: Name of the link.
        pose: Pose of the box in the world; the link's orientation is that of the box, within the tolerance.
        size: Lengths of the box along its axes [m].
        orientation_tolerance: Largest rotation about each axis [rad]; from pi on, any orientation.
    """

    link: str
    pose: Pose
    size: Vector
    orientation_tolerance: float = math.pi

    def __post_init__(self) -> None:
        if len(self.size) != 3 or not (np.isfinite(self.size).all() and min(self.size) >= 0.0):
            raise ValueError(f"size: expected 3 numbers that are not negative, got {self.size}")

    def states(
        self, scene: PlanningScene, robot: SceneRobot, moving: Sequence[int], start: Array, seed: int
    ) -> GoalStates:
        """See `PlanningGoal`."""
        generator = random.Random(seed)
        x, y, z = self.size
        places = [(0.0, 0.0, 0.0)] + [
            (generator.uniform(-x, x) / 2.0, generator.uniform(-y, y) / 2.0, generator.uniform(-z, z) / 2.0)
            for _ in range(REGION_SAMPLES)
        ]
        poses = [self.pose @ Pose(place) for place in places]
        small, angles = (0.0,) * 3, (self.orientation_tolerance,) * 3
        return _solved(robot, self.link, poses, small, angles, moving, start, seed)


GOALS: dict[str, type[PlanningGoal]] = {"joints": JointGoal, "pose": PoseGoal, "region": RegionGoal, "named": NamedGoal}


def goal_from(data: Mapping[str, Any]) -> PlanningGoal:
    """Makes a goal from a mapping, such as `{type: pose, link: panda_hand, pose: {position: [0.4, 0, 0.5]}}`.

    Raises:
        ValueError: If the type or a key is unknown, or a value is invalid; the message names the key.
    """
    found: PlanningGoal = built(GOALS, "goal", data)
    return found


_solvers: dict[tuple[str, str, str], Callable[[], GlobalSolver]] = {}
"""Solvers that were made before, by URDF, root and tip."""


def _solver(robot: SceneRobot, link: str) -> GlobalSolver:
    root = robot.model.root
    key = robot.model.urdf_path, root, link
    if key not in _solvers:
        options = {"urdf_filename": robot.model.urdf_path, "base_link": root, "tip_link": link, "restarts": RESTARTS}
        solver = GlobalSolver(GlobalConfig.parse(options, robot.model.urdf_path))
        _solvers[key] = lambda: solver
    return _solvers[key]()


def _solved(
    robot: SceneRobot,
    link: str,
    poses: Sequence[Pose],
    position_tolerance: Vector,
    rotation_tolerance: Vector,
    moving: Sequence[int],
    start: Array,
    seed: int,
) -> GoalStates:
    """Solves inverse kinematics for several poses of a link in the world."""
    names = robot.model.joint_names
    robot.model.check_link(link)
    if not any(joint.is_moving for joint in robot.model.chain(link)):
        raise ValueError(f"goal: no joint moves link '{link}'")
    solver = _solver(robot, link)
    low, high = list(solver.description.limits.lower), list(solver.description.limits.upper)
    for i, joint in enumerate(solver.joint_names):
        if joint in names and names.index(joint) in moving:
            at = names.index(joint)
            low[i], high[i] = float(robot.limits.lower[at]), float(robot.limits.upper[at])
        else:
            still = float(start[names.index(joint)]) if joint in names else robot.model.all_joints[joint].rest
            low[i], high[i] = still - FIXED, still + FIXED
    solver.use_limits(Limits(low, high, solver.description.limits.is_revolute))
    inverse, given = robot.base.inverse(), dict(zip(names, start.tolist()))
    from_start = {joint: given[joint] for joint in solver.joint_names if joint in given}
    states, message = [], ""
    for pose in poses:
        problem = IKProblem(inverse @ pose, position_tolerance, rotation_tolerance, from_start, seed=seed)
        solution = solver.solve(problem)
        if not solution.success:
            message = message or f"the goal cannot be reached: {solution.message}"
            continue
        for found in (solution.positions, *solution.alternatives):
            state = start.copy()
            for joint, position in zip(solver.joint_names, found):
                if joint in names and names.index(joint) in moving:
                    state[names.index(joint)] = position
            states.append(state)
    if not states:
        return GoalStates(np.empty((0, len(start))), message)
    return GoalStates(np.array(states))
