"""Two arms reach into the compartments of a bookcase on planned paths, and yield to blocks that move in front of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pybullet_data

from custom_ros_tools.config import replace_package
from robot_model.asset_files import find_file
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose, angle_between, minus, norm, plus
from robot_model.model import RobotModel
from rpbi_planning import PlanningScene, PoseGoal, plan

from .parts.person import together
from .parts.yielding import Blocking, Rail, YieldingArm, moving
from .scene import Scene, SceneFailedError, Watched

URDF, LINK = "kuka_iiwa/model.urdf", "lbr_iiwa_link_7"
"""URDF of the arms, and link that reaches into compartments."""
BASES = {"left": Pose((0.0, 0.55, 0.5)), "right": Pose((0.0, -0.55, 0.5))}
COLUMNS_M, ROWS_M = (0.1875, 0.5625), (0.78, 1.16)
"""Distances of the compartments' middles from the middle of the bookcase, and heights of the goals [m]."""
DEPTHS_M, OFF_M = (0.75, 0.79), 0.04
"""Range of x of the goals, and largest distance of a goal from the middle of its compartment along y and z [m]."""
INTO = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
"""Orientation of the link whose z axis points into the bookcase."""
SHOULDER_M, HAND_M, REACH_M = 0.36, 0.081, 0.8
"""Height of the shoulder above the base, distance of the link from the wrist, and largest distance of a wrist from the
shoulder at a goal, 20 mm less than with a stretched arm [m]; see joints 2, 4, 6 and 7 in the URDF.
"""
GOALS = 2
"""Number of goals of each arm."""
NEAR_M, NEAR_RAD = 0.01, math.radians(3.0)
"""Largest error at a goal."""
STAY_S, CYCLE_S = 0.3, 0.02
"""Time for which an arm stays at a goal, and duration of a cycle [s]."""
RAILS = tuple(
    Rail(name, "rail_joint", (0.6, 0.0, height), 1.1, (0.1, 0.14, 0.14), 0.1)
    for name, height in (("lower_carriage", 0.8), ("upper_carriage", 1.18))
)
OPTIONS: dict[str, Any] = {"planner": "projected", "time_limit_s": 60.0, "shorten_s": 60.0, "certify": False}
"""Options of the planner. Its random numbers depend only on the seed, and its time limits are never reached, so that an
episode does not depend on the speed of the computer.
"""
HARMLESS = {"station", "floor"}
"""Bodies on which the arms stand."""


class Shelves(Scene):
    """Two KUKA iiwa arms reach into compartments of a bookcase in turn, and never touch the blocks that pass by.

    Attributes:
        goals: Poses of the link in the world, for each arm.
        visited: Number of goals that each arm has reached.
    """

    world = "{rpbi_examples}/configs/shelves/config.yaml"
    watch = Watched(robots=(*BASES, *(rail.robot for rail in RAILS)), contacts=tuple(BASES))
    others = tuple(rail.robot for rail in RAILS)
    of = GOALS * len(BASES)
    longest_s = 180.0

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self.goals = {name: [_goal(random, base) for _ in range(GOALS)] for name, base in BASES.items()}
        self.goal_numbers = tuple(number for goals in self.goals.values() for goal in goals for number in goal.position)
        self.visited = {name: 0 for name in BASES}
        self._stayed_s = {name: 0.0 for name in BASES}
        self._touched: set[str] = set()
        self._arms: dict[str, YieldingArm] = {}
        self._carriage_random = random.spawn(len(RAILS))

    def act(self) -> Iterator[None]:
        """Moves both arms to their goals, while the carriages move."""
        carriages = self.beside()
        for _ in together(*(self._visit(name) for name in BASES)):
            next(carriages)
            yield

    def beside(self) -> Iterator[None]:
        """Moves the carriages."""
        yield from together(*(moving(self, *each, CYCLE_S) for each in zip(RAILS, self._carriage_random)))

    def note(self) -> None:
        """Records which goals are reached, in their order, and which bodies the arms have touched."""
        for name, count in self.visited.items():
            self._touched |= {each.other for each in self.seen.contacts[name]} - HARMLESS
            if count < GOALS:
                self._stayed_s[name] = (self._stayed_s[name] + CYCLE_S) * self._is_at(name, self.goals[name][count])
                if self._stayed_s[name] >= STAY_S - CYCLE_S:
                    self.visited[name], self._stayed_s[name] = count + 1, 0.0

    def has_succeeded(self) -> bool:
        """Returns whether both arms have been at all their goals, and have touched nothing."""
        return sum(self.visited.values()) == self.of and not self._touched

    def score(self) -> tuple[int, int]:
        """Returns the number of reached goals, or 0 after a touch, and the number of all goals."""
        return 0 if self._touched else sum(self.visited.values()), self.of

    def fault(self) -> str:
        """Returns the bodies that were touched, or the number of goals that were not reached."""
        if self._touched:
            return f"touched: {', '.join(sorted(self._touched))}"
        return f"{self.of - sum(self.visited.values())} goals not reached"

    def figures(self) -> dict[str, float]:
        """Returns the time for which the arms waited for carriages or retreated."""
        return {"waited [s]": sum(arm.waited_s for arm in self._arms.values())}

    def _visit(self, name: str) -> Iterator[None]:
        scene, joints = planning_scene(), self.seen.joints[name]
        arm = self._arms[name] = YieldingArm(self, name, tuple(joints), blocking(name), CYCLE_S)
        home = dict(joints)
        for goal in self.goals[name]:
            tolerances = {"position_tolerance": NEAR_M / 4.0, "orientation_tolerance": NEAR_RAD / 4.0}
            wanted = PoseGoal(link=LINK, pose=goal, **tolerances)
            seed = int(self.random.integers(1 << 16))
            planned = plan(scene, name, wanted, start=home, seed=seed, **OPTIONS)
            if not planned.success:
                raise SceneFailedError(f"{name}: no path to {goal.position}: {planned.message}")
            for _ in arm.visit(planned.trajectory, STAY_S + 0.3):
                yield

    def _is_at(self, name: str, goal: Pose) -> bool:
        model = robot_model()
        joints = self.seen.joints[name]
        pose = BASES[name] @ model.pose([joints[each] for each in model.joint_names], LINK)
        is_near = norm(minus(pose.position, goal.position)) < NEAR_M
        return is_near and angle_between(pose.quat_xyzw, goal.quat_xyzw) < NEAR_RAD


@cache
def robot_model() -> RobotModel:
    """Returns the kinematics of an arm."""
    return RobotModel(find_file(URDF, ".", (pybullet_data.getDataPath(),)))


@cache
def blocking(name: str) -> Blocking:
    """Returns the object that finds positions of carriages that are too near to an arm."""
    return Blocking(robot_model().urdf_path, BASES[name], RAILS)


@cache
def planning_scene() -> PlanningScene:
    """Returns the scene in which both arms plan: without carriages, and with a wall between the arms."""
    scene = PlanningScene.from_yaml(replace_package(Shelves.world))
    for rail in RAILS:
        scene.remove(rail.robot)
    scene.add(Obstacle("wall", "box", (2.0, 0.1, 3.0), Pose((0.3, 0.0, 1.5))))
    return scene


def _goal(random: np.random.Generator, base: Pose) -> Pose:
    """Returns a random pose of the link in a compartment on the side of an arm, within the arm's reach.

    Args:
        random: Random generator.
        base: Pose of the arm's root link in the world.
    """
    while True:
        x, off_y, off_z = random.uniform((DEPTHS_M[0], -OFF_M, -OFF_M), (DEPTHS_M[1], OFF_M, OFF_M)).tolist()
        y, z = float(random.choice(COLUMNS_M)), float(random.choice(ROWS_M))
        place = (x, math.copysign(y + off_y, base.position[1]), z + off_z)
        if norm(minus(place, plus(base.position, (HAND_M, 0.0, SHOULDER_M)))) <= REACH_M:
            return Pose(place, INTO)
