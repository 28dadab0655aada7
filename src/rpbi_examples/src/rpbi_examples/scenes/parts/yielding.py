"""Moves an arm along a planned path, and back when a carriage on a rail could come into the arm's way.

The carriages move as they like, but not faster than a known speed. In every cycle, the arm advances only if it could
still retreat to the start of the path before any carriage reaches it. Therefore no carriage ever touches the arm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.config import replace_package
from custom_ros_tools.transforms import Array
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose, Vector, plus
from robot_model.model import RobotModel
from rpbi_examples.scenes.scene import Scene
from safe_robot.checks.proximity_check import link_distances

SAMPLE_S = 0.04
"""Time between two samples of a path at which distances to carriages are measured [s]."""
CELL_M = 0.03
"""Distance between two positions on a rail at which distances are measured [m]."""
MARGIN_M = 0.04
"""Least distance between arm and carriage [m], in addition to half a cell."""
TURN_S = 0.3
"""Time in which an arm changes from full speed along its path to rest, or from rest to full speed [s]."""


class Rail(NamedTuple):
    """A rail along y, with a carriage.

    Attributes:
        robot: Name of the carriage's robot in the world.
        joint: Joint of the carriage, whose position is the carriage's y in the rail's frame [m].
        middle: Position of the rail's middle in the world [m].
        half_m: Largest distance of the carriage from the middle [m].
        size: Extents of the carriage along x, y and z [m].
        speed: Largest speed of the carriage [m/s].
    """

    robot: str
    joint: str
    middle: Vector
    half_m: float
    size: Vector
    speed: float


class Blocking:
    """Finds the positions of carriages at which they are too near to an arm.

    Args:
        urdf: URDF of the arm.
        base: Pose of the arm's root link in the world.
        rails: The rails.
    """

    def __init__(self, urdf: str, base: Pose, rails: Sequence[Rail]) -> None:
        self.rails = tuple(rails)
        self._distances = link_distances(RobotModel(replace_package(urdf)))
        cells = [np.arange(-rail.half_m, rail.half_m + CELL_M / 2.0, CELL_M) for rail in self.rails]
        self._obstacles = []
        for rail, at in zip(self.rails, cells):
            x, y, z = rail.size
            places = [(rail.middle, (x, y + 2.0 * rail.half_m, z))]  # first the whole rail, which is rarely near
            places += [(plus(rail.middle, (0.0, float(offset), 0.0)), rail.size) for offset in at]
            root = base.inverse()
            self._obstacles.append([Obstacle(rail.robot, "box", size, root @ Pose(place)) for place, size in places])
        self._distances.place_obstacles([each for of_rail in self._obstacles for each in of_rail])

    def along(self, path: Array) -> list[Array]:
        """Returns a table for each rail: whether the carriage is too near, shape (k, number of cells).

        Args:
            path: Positions of the arm's n joints [rad], shape (k, n).
        """
        tables = [np.array(rows) for rows in zip(*(self._at(q) for q in path))]
        return [table | np.roll(table, 1, axis=0) | np.roll(table, -1, axis=0) for table in tables]  # between samples

    def _at(self, q: Array) -> list[Array]:
        self._distances.place(q)
        first, found = 0, []
        for obstacles in self._obstacles:
            near = [link for link in self._distances.links if self._is_near(link, first)]
            numbers = range(first + 1, first + len(obstacles))
            found.append(np.array([any(self._is_near(link, number) for link in near) for number in numbers]))
            first += len(obstacles)
        return found

    def _is_near(self, link: str, number: int) -> bool:
        most_m = MARGIN_M + CELL_M / 2.0
        return self._distances.distance((link, number), most_m) <= most_m


class YieldingArm:
    """Leads an arm along a path and back, and retreats from carriages.

    Args:
        scene: Scene in which the arm acts.
        robot: Name of the arm in the world.
        joint_names: Names of the n joints.
        blocking: Positions of carriages that are too near.
        period_s: Duration of a cycle [s].
    """

    def __init__(
        self, scene: Scene, robot: str, joint_names: Sequence[str], blocking: Blocking, period_s: float
    ) -> None:
        self._scene, self._robot, self._joint_names = scene, robot, tuple(joint_names)
        self._blocking, self._period_s = blocking, period_s
        self.waited_s = 0.0
        """Time for which the arm did not advance, although it was not at its goal [s]."""

    def visit(self, trajectory: Any, stay_s: float) -> Iterator[bool]:
        """Moves along a trajectory, stays at its end, and moves back to its start.

        Args:
            trajectory: Has `times` of shape (k,) [s] and `positions` of shape (k, n) [rad]. At the start, no carriage
                may come near.
            stay_s: Time for which the arm stays at the end [s].

        Yields:
            In each cycle, whether the arm is at the end.
        """
        end_s = float(trajectory.times[-1])
        at_s = np.append(np.arange(0.0, end_s, SAMPLE_S), [end_s])
        path = np.column_stack([np.interp(at_s, trajectory.times, each) for each in np.asarray(trajectory.positions).T])
        blocked, speed_limit = self._blocking.along(path), self._period_s / TURN_S
        now_s, rate, stayed_s = 0.0, 0.0, 0.0
        while stayed_s < stay_s or now_s > 0.0:
            wanted = 1.0 if stayed_s < stay_s else -1.0
            choices = [float(np.clip(each, rate - speed_limit, rate + speed_limit)) for each in (wanted, 0.0)]
            rate = next((each for each in choices if self._is_safe(now_s, each, end_s, blocked)), rate - speed_limit)
            rate = min(max(rate, -1.0), 1.0, (end_s - now_s) / self._period_s)
            self.waited_s += self._period_s * (rate * wanted <= 0.0 and 0.0 < now_s < end_s)
            now_s = max(now_s + rate * self._period_s, 0.0)
            rate *= now_s > 0.0
            is_there = end_s - now_s < 1e-9
            stayed_s += self._period_s * is_there
            target = [float(np.interp(now_s, at_s, column)) for column in path.T]
            self._scene.put(f"{self._robot}/target", dict(zip(self._joint_names, target)))
            yield is_there

    def _is_safe(self, now_s: float, rate: float, end_s: float, blocked: list[Array]) -> bool:
        """Returns whether the arm can retreat after a cycle with a speed `rate` along its path."""
        period_s, slowing = self._period_s, self._period_s / TURN_S
        count = int((now_s + period_s + TURN_S) / period_s + 2.0 * TURN_S / period_s) + 3
        rates = np.maximum(rate - slowing * np.arange(count), -1.0)
        path_s = np.minimum(now_s + period_s * np.cumsum(rates), end_s)
        path_s = path_s[: int(np.argmax(path_s <= 0.0)) + 1] if (path_s <= 0.0).any() else path_s
        rows = np.ceil(np.maximum(path_s, 0.0) / SAMPLE_S).astype(int)
        after_s = period_s * (1.0 + np.arange(len(path_s)))
        return not any(
            self._is_reached(rail, table, np.minimum(rows, len(table) - 1), after_s)
            for rail, table in zip(self._blocking.rails, blocked)
        )

    def _is_reached(self, rail: Rail, table: Array, rows: Array, after_s: Array) -> bool:
        """Returns whether a carriage can come to a blocked cell in time.

        Args:
            rail: Rail of the carriage.
            table: Whether cells are blocked at samples of the path, shape (k, number of cells).
            rows: Samples of the path that the arm passes, shape (m,).
            after_s: Times until the arm passes them [s], shape (m,).
        """
        place = self._scene.seen.joints[rail.robot][rail.joint] + rail.half_m
        last = table.shape[1] - 1
        low = np.clip(np.floor((place - rail.speed * after_s) / CELL_M), 0, last).astype(int)
        high = np.clip(np.ceil((place + rail.speed * after_s) / CELL_M), 0, last).astype(int)
        counts = np.pad(np.cumsum(table, axis=1), ((0, 0), (1, 0)))
        return bool((counts[rows, high + 1] > counts[rows, low]).any())


def moving(scene: Scene, rail: Rail, random: np.random.Generator, period_s: float) -> Iterator[None]:
    """Moves a carriage between random places at random speeds, with pauses, forever."""
    at_m = scene.seen.joints[rail.robot][rail.joint]
    while True:
        goal_m = float(random.uniform(-rail.half_m, rail.half_m))
        step_m = float(random.uniform(0.4, 0.9)) * rail.speed * period_s
        while at_m != goal_m:
            at_m += float(np.clip(goal_m - at_m, -step_m, step_m))
            scene.put(f"{rail.robot}/target", {rail.joint: at_m})
            yield
        for _ in range(int(random.uniform(0.3, 2.0) / period_s)):
            yield
