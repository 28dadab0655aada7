"""Hill climbing on the smallest distance that a guard permits, braking included."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot_model.collision.distances import Geometry
from safe_robot.checks.proximity_check import link_distances
from safe_robot.guard import Guard

from .scenes import MARGIN_M, Scene

GOALS, LONGEST = 3, 15
"""Number of goals of a course, and largest number of periods for which each is the target."""
SPREAD, FINEST = 0.3, 0.003
"""Standard deviations of the changes of goals, at the start and at the end [rad]."""
CHANGED = 0.3
"""Share of the numbers of a course that a mutation changes."""
AROUND_M = 0.023
"""Largest distance from a body at which a course begins [m]."""
SAMPLES, NEAR_M = 3, 0.03
"""Number of judged rows of a braking motion, and the distance [m] below which all rows are judged."""
TOLERANCE_M = 1e-6
"""Largest violation of the margin that is tolerated [m]."""


class Course(NamedTuple):
    """Targets for a robot.

    Attributes:
        start: n initial positions of the robot at rest [rad].
        goals: Positions that are asked for one after the other, GOALS x n [rad].
        periods: Number of periods for which each goal is asked for.
    """

    start: np.ndarray
    goals: np.ndarray
    periods: np.ndarray


class Climber:
    """Mutates courses so that the robot approaches bodies more and more.

    Every command counts, and so does every braking that the guard holds ready after one, since a target that is no
    target would have it sent. Distances are those of links to boxes as the guard measures them, but at every command.

    Args:
        scene: The robot and the boxes around it.
        guard: A guard of that robot.
        generator: Source of random numbers.
        geometry: `hulls` or `exact`, as the guard has it.
    """

    def __init__(
        self, scene: Scene, guard: Guard, generator: np.random.Generator, geometry: Geometry = "hulls"
    ) -> None:
        self._scene, self._guard, self._generator = scene, guard, generator
        self._distances = link_distances(guard.robot, geometry)
        boxes = scene.around.obstacles or ()
        self._distances.place_obstacles(boxes)
        links = [link for link in self._distances.links if self._distances.reach((link, 0)).any()]
        self._pairs = [(link, i) for link in links for i in range(len(boxes))]

    def climb(self, steps: int) -> tuple[float, Course]:
        """Returns the smallest distance of one climb [m], and its course.

        It ends before, when it has found a distance below the margin.
        """
        best = self._random_course()
        least_m = self.smallest_distance(best)
        for step in range(steps):
            if least_m < MARGIN_M - TOLERANCE_M:
                break
            course = self._changed(best, SPREAD * (FINEST / SPREAD) ** (step / steps))
            found_m = self.smallest_distance(course)
            if found_m <= least_m:
                best, least_m = course, found_m
        return least_m, best

    def smallest_distance(self, course: Course) -> float:
        """Returns the smallest distance at any command of a course, and while braking from it [m]."""
        guard, around = self._guard, self._scene.around
        guard.rest()
        guard.start()
        start = around._replace(measured=dict(zip(guard.joint_names, course.start.tolist())))
        if guard.decide(course.start.tolist(), start).command is None:
            return math.inf  # it begins too near to itself
        least_m = self._nearest(course.start)
        ready = np.empty((0, len(course.start)))
        for goal in np.repeat(course.goals, course.periods, axis=0).tolist():
            decision = guard.decide(goal, around)
            assert decision.command is not None
            followed, ready = ready, guard.stop_commands
            if len(followed) and decision.command == tuple(followed[0].tolist()) and len(ready) == len(followed) - 1:
                continue  # the braking continues and has been judged
            least_m = min(least_m, self._smallest_of(np.array([decision.command, *ready])))
        return least_m

    def _nearest(self, q: np.ndarray) -> float:
        self._distances.place(q)
        return min(self._distances.distance(pair, math.inf, NEAR_M) for pair in self._pairs)

    def _smallest_of(self, rows: np.ndarray) -> float:
        """Returns the smallest distance in k configurations [m]; of only some of them if no body is near."""
        some = rows[np.linspace(0, len(rows) - 1, SAMPLES).astype(int)]
        least_m = min(map(self._nearest, some))
        return least_m if least_m > NEAR_M else min(map(self._nearest, rows))

    def _random_course(self) -> Course:
        """Returns a course that begins just outside the margin; some of the joints have other goals."""
        inside = outside = self._scene.home
        while self._nearest(inside) > MARGIN_M:
            inside = np.clip(self._moved(self._scene.home, 2.0), self._guard.limits.lower, self._guard.limits.upper)
        while not self._may_start(outside):
            middle = (inside + outside) / 2.0
            inside, outside = (inside, middle) if self._nearest(middle) > MARGIN_M else (middle, outside)
        goals = self._moved(np.tile(outside, (GOALS, 1)), SPREAD)
        return Course(outside, goals, self._generator.integers(2, LONGEST, GOALS))

    def _changed(self, course: Course, spread: float) -> Course:
        start = self._moved(course.start, spread / 10.0)
        periods = np.clip(np.rint(self._moved(course.periods, 2.0)), 1, LONGEST).astype(int)
        return Course(start if self._may_start(start) else course.start, self._moved(course.goals, spread), periods)

    def _moved(self, values: np.ndarray, spread: float) -> np.ndarray:
        by = self._generator.normal(0.0, spread, values.shape)
        return values + by * (self._generator.random(values.shape) < CHANGED)

    def _may_start(self, q: np.ndarray) -> bool:
        is_within_limits = ((q > self._guard.limits.lower) & (q < self._guard.limits.upper)).all()
        return bool(is_within_limits and MARGIN_M + TOLERANCE_M < self._nearest(q) < AROUND_M)
