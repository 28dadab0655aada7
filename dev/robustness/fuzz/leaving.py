"""Sends a robot of two joints from states inside the margin out of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from safe_robot.commands.escape import MIN_SPEED_SHARE, STEP, EscapeDirection
from safe_robot.guard import Guard

from .grid import Grid
from .oracle import Oracle
from .scenes import MARGIN_M, Scene

NEARER_M = 1e-4
"""Largest approach of a pair inside its margin [m]; the guard's boxes have rounded edges."""
BETWEEN_M = 0.002
"""Largest violation of the margin by a pair outside of it [m]; braking is not tried everywhere."""
LEG, MAX_LEGS, MAX_COMMANDS = 0.1, 60, 400
"""Length of a step out of the margin [rad], number of steps, and number of commands for each."""
CLEAR = 1.5
AROUND = 16
"""Number of directions in which targets are tried where the exits that the guard names lead nowhere."""
SMALLER = 0.5
"""The margin with which a locked robot is driven out, as a share of the smallest distance."""


class Leaving(NamedTuple):
    """Results of states inside the margin: number of states by kind of exit.

    Attributes:
        straight: States with a straight way on which no pair that is inside its margin comes nearer, and none comes in.
        curved: States without, or where it stood on such a way, which the robot left by the ways that the guard told
            of, or along what is in the way.
        locked: States from where these ways led to where the guard says that there is none, and so does the oracle;
            with a smaller margin the robot left.
        narrow: The same, but the oracle sees a way.
        stuck: What should not be, in words.
        slowest: The least share of the speed that the robot has without things around it, on straight ways.
        nearer_m: By how much anything came nearer that was inside its margin, at most [m].
    """

    straight: int
    curved: int
    locked: int
    narrow: int
    stuck: list[str]
    slowest: float
    nearer_m: float


def leave_margin(scene: Scene, oracle: Oracle, count: int, generator: np.random.Generator) -> Leaving:
    """Starts in configurations inside the margin, and tries to leave it.

    Straight ways are asked for at once, by a target at their end; on the others, the robot follows `Guard.way_out`.

    Args:
        scene: A robot of two joints and its surroundings.
        oracle: What judges.
        count: How many configurations.
        generator: What they are random by.
    """
    driver, free = Driver(scene), Driver(scene, around=False)
    grid, found = Grid(oracle), Counter[str]()
    stuck, slowest, nearer_m = list[str](), 1.0, 0.0
    while found.total() + len(stuck) < count:
        q = generator.uniform(oracle.lower, oracle.upper)
        if not 0.0 < oracle.distances(q).min() < MARGIN_M:
            continue
        way = straight_way(oracle, q, generator)
        if way is None:
            commands = driver.follow(q)
            kind = _gets_out(driver, oracle, commands)
        else:
            commands, freely = (each.drive(q, q + way) for each in (driver, free))
            fastest, usual = (float(np.abs(np.diff(each, axis=0)).max()) for each in (commands, freely))
            slowest = min(slowest, fastest / usual)
            kind = "straight"
            if not _is_outside(oracle, commands[-1]):
                commands = np.concatenate((commands, driver.follow(commands[-1])))
                kind = _gets_out(driver, oracle, commands)
        fault = fault_of(oracle, commands)
        nearer_m = max(nearer_m, _nearer_m(oracle, commands))
        out = None if kind else driver.guard.way_out()
        if out is not None and out.is_locked:
            kind = "locked" if is_locked(oracle, commands[-1]) else "narrow"
            fault = fault or leave_with_smaller_margin(scene, oracle, grid, commands[-1], out)
        if kind is None or fault is not None:
            stuck.append(f"{q} to {commands[-1]}: {fault or 'stood'}")
        else:
            found[kind] += 1
    kinds = (found[each] for each in ("straight", "curved", "locked", "narrow"))
    return Leaving(*kinds, stuck, slowest, nearer_m)


class Driver:
    """Sends targets to a guard of the policy `limit`.

    Args:
        scene: A robot and its surroundings.
        around: Whether shapes are checked.
        margin_m: The margin [m].
    """

    def __init__(self, scene: Scene, around: bool = True, margin_m: float = MARGIN_M) -> None:
        self.guard: Guard = scene.guard("limit", around, margin_m=margin_m)
        self._around = scene.around

    def drive(self, start: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Returns the commands to a robot at rest that is sent to a target, from the start on."""
        self.guard.halt()
        self.guard.start()
        measured = dict(zip(self.guard.joint_names, start.tolist()))
        self.guard.decide(tuple(start.tolist()), self._around._replace(measured=measured))
        return np.array([start, *self.until_rest(target)])

    def until_rest(self, target: np.ndarray) -> list[tuple[float, ...]]:
        """Returns the commands when the robot is sent to a target."""
        commands = list[tuple[float, ...]]()
        for _ in range(MAX_COMMANDS):
            decision = self.guard.decide(tuple(target.tolist()), self._around)
            assert decision.command is not None
            if commands and decision.command == commands[-1]:
                break
            commands.append(decision.command)
        return commands

    def follow(self, start: np.ndarray) -> np.ndarray:
        """Returns the commands when a robot is sent to the exit that the guard names."""
        commands = list(self.drive(start, start))
        limits = self.guard.limits
        for _ in range(MAX_LEGS):
            out = self.guard.way_out()
            if out is None or out.direction is None:
                break
            target = np.clip(commands[-1] + LEG * out.direction, limits.lower, limits.upper)
            commands += [np.array(command) for command in self.until_rest(target)]
        return np.array(commands)


def leave_with_smaller_margin(
    scene: Scene, oracle: Oracle, grid: Grid, start: np.ndarray, out: EscapeDirection
) -> str | None:
    """Drives a locked robot out, as docs/safety.md advises; returns the fault, None if it got out.

    The guard has a margin below all distances that the message told of. The way is the shortest one on a grid over
    places that keep more than this margin.
    """
    margin_m = SMALLER * max(0.0, min(one.distance_m for one in out.inside))
    way = grid.way_out(start, SMALLER * oracle.distances(start).min(), MARGIN_M)
    if way is None:
        return "no way out on the grid"
    driver = Driver(scene, margin_m=margin_m)
    commands = list(driver.drive(start, way[0]))
    for target in way[1:]:
        commands += [np.array(command) for command in driver.until_rest(target)]
    if not _distances_on(oracle, commands).min() > 0.0:
        return "touched something"
    if not _is_outside(oracle, commands[-1]):
        return f"stood at {commands[-1]} with a margin of {1e3 * margin_m:.1f} mm on the way {way}"
    return None


def straight_way(oracle: Oracle, q: np.ndarray, generator: np.random.Generator) -> np.ndarray | None:
    """Returns a straight path out on which no pair inside its margin approaches, and no other pair enters its margin.

    Of those that are found it is the one that leads away the least at first.
    """
    angles = generator.uniform(-math.pi, math.pi, 96)
    ways = np.repeat((0.1, 0.2, 0.4, 0.8), 24)[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    ways = ways[((q + ways > oracle.lower) & (q + ways < oracle.upper)).all(axis=1)]
    now = _distances_on(oracle, [q])
    first = _distances_on(oracle, q + 0.002 * ways / np.linalg.norm(ways, axis=1)[:, None]) - now
    order = np.argsort(first.sum(axis=1))
    for way in ways[[i for i in order if first[i].min() >= 0.0]]:
        if oracle.distances(q + way).min() >= 1.1 * MARGIN_M:
            shares = np.linspace(0.0, 1.0, 1 + math.ceil(np.abs(way).max() / 0.005))
            if (np.diff(_distances_on(oracle, q + shares[:, None] * way), axis=0) >= 0.0).all():
                return way
    return None


def fault_of(oracle: Oracle, commands: np.ndarray) -> str | None:
    """Returns by how much a pair comes nearer than initially and than its margin, None if none does."""
    distances = _distances_on(oracle, commands)
    nearer = distances[0] - distances
    is_allowed = nearer <= np.where(distances[0] < MARGIN_M, NEARER_M, BETWEEN_M)
    return None if is_allowed.all() else f"nearer by {1e6 * nearer[~is_allowed].max():.3g} um"


def _nearer_m(oracle: Oracle, commands: np.ndarray) -> float:
    """Returns the largest approach of a pair that is initially inside its margin [m]."""
    distances = _distances_on(oracle, commands)
    return float((distances[0] - distances)[:, distances[0] < MARGIN_M].max(initial=0.0))


def is_locked(oracle: Oracle, q: np.ndarray) -> bool:
    """Returns whether no small motion of many directions separates all pairs inside the margin.

    It is as `safe_robot.way_out` has it: by a share of how fast each can go apart by itself, and nothing else comes in.
    Since both measure that over a step, the oracle asks for some more.
    """
    now = oracle.distances(q)
    is_inside = now < MARGIN_M
    angles = np.arange(720) * math.pi / 360.0
    after = np.array([oracle.distances(q + STEP * way) for way in np.stack((np.cos(angles), np.sin(angles)), axis=1)])
    gains = (after - now)[:, is_inside]
    is_good = (gains > CLEAR * MIN_SPEED_SHARE * gains.max(axis=0)).all(axis=1) & (
        after[:, ~is_inside] >= MARGIN_M
    ).all(axis=1)
    return not is_good.any()


def _gets_out(driver: Driver, oracle: Oracle, commands: np.ndarray) -> str | None:
    """Returns whether the robot got out of the margin, or does so along what is in the way to targets all around."""
    if _is_outside(oracle, commands[-1]):
        return "curved"
    for angle in np.arange(AROUND) * 2.0 * math.pi / AROUND:
        target = np.clip(commands[0] + 0.5 * np.array((math.cos(angle), math.sin(angle))), oracle.lower, oracle.upper)
        others = driver.drive(commands[0], target)
        if _is_outside(oracle, others[-1]) and fault_of(oracle, others) is None:
            return "curved"
    driver.drive(commands[-1], commands[-1])
    return None


def _is_outside(oracle: Oracle, q: np.ndarray) -> bool:
    return bool(oracle.distances(q).min() > MARGIN_M)


def _distances_on(oracle: Oracle, rows: Sequence[np.ndarray]) -> np.ndarray:
    """Returns distances in k configurations, those beyond the margin as the margin [m]."""
    return np.minimum([oracle.distances(row) for row in rows], MARGIN_M)
