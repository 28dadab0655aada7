"""Hostile targets for the guard, judged by an oracle that knows nothing of it: differences of commands, exact shapes.

    ./rpbi shell -c 'python3 benchmarks/guard_fuzz.py --targets 1000000 --seed 0'

Not one of the benchmarks that `./rpbi bench` runs. It prints a table; it ends with 1 if a command was not safe.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet

from rpbi.geometry import Pose
from safe_robot.check import Situation
from safe_robot.commands.way_out import SLIGHT, STEP
from safe_robot.config import GuardConfig
from safe_robot.geometry.obstacles import Obstacle
from safe_robot.guard import Guard
from safe_robot.robot import GuardedRobot

PERIOD_S = 0.01
LIMITS = {"velocity": 1.0, "acceleration": 8.0, "jerk": 200.0}
MARGIN_M = 0.02
ROUNDING = 1e-6
"""Relative, of the oracle's differences."""
NEARER_M = 1e-7
"""Two things that come nearer by no more than this do not, for the oracle [m]."""
BETWEEN_M = 0.002
"""What was outside its margin may come into it by so much, since a braking is not tried everywhere [m]."""
LEG, MOST_LEGS, MOST_COMMANDS = 0.1, 60, 400
"""How far the robot is sent on a way out at once [rad], how often, and how many commands it is given for it."""
CLEAR = 1.5
AROUND = 16
"""Where the ways that the guard tells of lead nowhere, targets in so many directions are tried."""
URDF = """<robot name="fuzzed">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper">
    <collision><origin xyz="0.2 0 0"/><geometry><box size="0.3 0.06 0.06"/></geometry></collision></link>
  <link name="lower">
    <collision><origin xyz="0.25 0 0"/><geometry><box size="0.4 0.06 0.06"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 0 1"/>
    <origin xyz="0.4 0 0"/><limit lower="-3" upper="3" effort="1" velocity="3"/></joint>
</robot>"""
"""Two boxes on a box: what folds meets the base, what goes round meets the table and the pole."""
LOWER, UPPER = np.array((-2.0, -3.0)), np.array((2.0, 3.0))
TABLE = (0.3, 0.5, 0.02), (0.5, 0.0, -0.35)
POLE = (0.04, 0.04, 0.6), (0.3, 0.62, 0.0)
"""Half extents and places of boxes [m]."""
PAIRS = ((-1, 1),)
"""Links that may meet, as PyBullet counts them."""


class Report(NamedTuple):
    """What came of some targets.

    Attributes:
        targets: How many.
        commands: How many were answered by one.
        refused: How many were not safe.
        worst: Largest share of each limit.
        nearest_m: The smallest distance.
        brakings: How many brakings were followed to their end.
        faults: What was not safe.
    """

    targets: int
    commands: int
    refused: int
    worst: dict[str, float]
    nearest_m: float
    brakings: int
    faults: list[str]


class Oracle:
    """Judges commands by what they are, in a PyBullet client of its own."""

    def __init__(self, urdf: str) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._robot = pybullet.loadURDF(urdf, useFixedBase=True, physicsClientId=self._client)
        self._boxes = []
        for half, place in (TABLE, POLE):
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
            self._boxes.append(pybullet.createMultiBody(0.0, shape, -1, place, physicsClientId=self._client))
        self.nearest_m = math.inf
        self.worst = dict.fromkeys(LIMITS, 0.0)
        self.faults: list[str] = []

    def place(self, q: Sequence[float]) -> float:
        """Judges where a command puts the robot; returns how near it is to anything [m]."""
        if not (np.isfinite(q).all() and (q >= LOWER - 1e-12).all() and (q <= UPPER + 1e-12).all()):
            self.faults.append(f"outside the limits of position: {q}")
        nearest = float(self.distances(q).min())
        if nearest <= 0.0:
            self.faults.append(f"in collision: {q}, {nearest:.3g} m")
        self.nearest_m = min(self.nearest_m, nearest)
        return nearest

    def distances(self, q: Sequence[float]) -> np.ndarray:
        """Returns how far the things of each pair are apart, more than 50 mm as 50 mm [m]."""
        for joint, position in enumerate(q):
            pybullet.resetJointState(self._robot, joint, position, physicsClientId=self._client)
        own = [self._distance(self._robot, a, b) for a, b in PAIRS]
        return np.array([*own, *(self._distance(box, link, -1) for box in self._boxes for link in (0, 1))])

    def _distance(self, other: int, a: int, b: int) -> float:
        points = pybullet.getClosestPoints(
            self._robot, other, 0.05, linkIndexA=a, linkIndexB=b, physicsClientId=self._client
        )
        return min((point[8] for point in points), default=0.05)

    def moves(self, commands: Sequence[Sequence[float]], from_rest: bool = True) -> None:
        """Judges the differences of successive commands, whether the robot stands before the first or not."""
        rows = np.array([commands[0]] * 3 * from_rest + list(commands))
        if len(rows) < 4:
            return
        for order, key in enumerate(LIMITS, start=1):
            share = float(np.abs(np.diff(rows, order, axis=0)).max()) / PERIOD_S**order / LIMITS[key]
            self.worst[key] = max(self.worst[key], share)
            if not share <= 1.0 + ROUNDING:
                self.faults.append(f"{key}: {share:.6f} of the limit")


class Target(NamedTuple):
    """A target, and what its stamp says."""

    position: tuple[float, ...]
    age_s: float = 0.0
    step_s: float | None = None


def adversary(generator: np.random.Generator, count: int, calm: float) -> Generator[Target, np.ndarray, None]:
    """Yields targets of every bad kind, between them ordinary ones.

    It is sent the last three commands.

    Args:
        calm: Share of ordinary ones; they keep the limits of joints, at most times.
    """
    at, far, stay = np.zeros(2), np.zeros(2), 0
    velocity, acceleration = np.zeros(2), np.zeros(2)
    age_s, step_s, size = 0.0, None, 2
    for _ in range(count):
        rows = yield Target((*at.tolist(), 0.0)[:size], age_s, step_s)
        age_s, step_s, size, stay = 0.0, None, 2, stay - 1
        at = rows[-1]
        velocity = (rows[-1] - rows[-2]) / PERIOD_S
        acceleration = (velocity - (rows[-2] - rows[-3]) / PERIOD_S) / PERIOD_S
        if stay > 0:
            at = far
        elif generator.random() < calm:
            wanted = 20.0 * generator.normal(size=2) * (generator.random() < 0.1) + 0.95 * acceleration - 0.5 * velocity
            acceleration = np.clip(wanted, acceleration - 1.9, acceleration + 1.9).clip(-7.8, 7.8)
            velocity = velocity + PERIOD_S * acceleration
            at = at + PERIOD_S * velocity
        else:
            kind = generator.integers(0, 9)
            if kind == 0:
                at = far = generator.uniform(-4.0, 4.0, 2)
                stay = int(generator.choice((1, 10, 300)))
            elif kind == 1:
                at = np.where(generator.random(2) < 0.5, generator.choice((math.nan, math.inf, -math.inf), 2), at)
            elif kind == 2:
                at = at + generator.normal(0.0, 10.0 ** generator.uniform(-9.0, 0.0), 2)
            elif kind == 3:
                at = at + PERIOD_S * generator.uniform(-4.0, 4.0, 2)
            elif kind == 4:
                age_s = float(generator.choice((0.2, -0.2, math.nan, math.inf, 1e9)))
            elif kind == 5:
                step_s = float(generator.choice((0.0, -1.0, math.nan)))
            elif kind == 6:
                at = at[::-1].copy()
            elif kind == 7:
                size = int(generator.choice((0, 1, 3)))
            else:
                at = np.where(generator.random(2) < 0.5, LOWER, UPPER) + generator.normal(0.0, 1e-6, 2)


def guard_of(urdf: str, policy: str, around: bool = True, **limits: float) -> Guard:
    """Returns a guard of the robot, with all checks of joints and, unless `around` is off, of shapes.

    Limits other than `LIMITS` are wrong.
    """
    shapes = {"margin_m": MARGIN_M, "active": around}
    checks: dict[str, Any] = {"environment": shapes, "self_collision": shapes}
    options = {
        "policy": policy,
        "period_s": PERIOD_S,
        "start_from": "target",
        "limits": {**LIMITS, **limits},
        "checks": checks,
    }
    guard = Guard(GuardConfig.parse(options, "fuzz"), GuardedRobot(urdf), "fuzz")
    guard.start()
    return guard


OBSTACLES = tuple(
    Obstacle(name, "box", (2.0 * half[0], 2.0 * half[1], 2.0 * half[2]), Pose(place))
    for name, (half, place) in (("table", TABLE), ("pole", POLE))
)


def fuzz(guard: Guard, oracle: Oracle, count: int, generator: np.random.Generator, every: int = 10) -> Report:
    """Sends hostile targets to a guard, and judges each command, and all of the braking from some.

    Args:
        guard: A started guard of the robot `URDF`.
        every: From so many commands one braking is judged.
    """
    calm = 0.6 if guard.config.policy == "limit" else 0.99
    targets, target = adversary(generator, count, calm), Target((0.0, 0.0))
    next(targets)
    run: list[tuple[float, ...]] = []
    last, from_rest = np.zeros((3, 2)), True
    commands = refused = brakings = 0
    for _ in range(count - 1):
        situation = Situation(age_s=target.age_s, stamp_step_s=target.step_s, obstacles=OBSTACLES)
        decision = guard.decide(target.position, situation)
        refused += decision.violation is not None
        if decision.command is not None:
            commands += 1
            run.append(decision.command)
            oracle.place(decision.command)
            if commands % every == 0 and len(stop := guard.stop_commands):
                brakings += 1
                for row in stop:
                    oracle.place(row)
                rest = [stop[-1].tolist()] * 3
                oracle.moves([*run[-4:], *stop.tolist(), *rest], from_rest and len(run) <= 4)
        if decision.is_halted:
            if run:
                oracle.moves(run, from_rest)
            run, from_rest, last = [], True, np.stack([last[-1]] * 3)
            guard.start()
        elif decision.command is not None:
            last = np.stack((*last[-2:], decision.command))
        if len(run) > 2000:
            oracle.moves(run, from_rest)
            run, from_rest = run[-4:], False
        target = targets.send(last)
    if run:
        oracle.moves(run, from_rest)
    return Report(count, commands, refused, oracle.worst, oracle.nearest_m, brakings, oracle.faults)


class Leaving(NamedTuple):
    """What came of states inside the margin: of how many there was which way out.

    Attributes:
        straight: States with a straight way on which no pair that is inside its margin comes nearer, and none comes in.
        curved: States without, which the robot left by the ways that the guard told of, or along what is in the way.
        locked: States from where these ways led to where the guard says that there is none, and so does the oracle.
        stuck: What should not be, in words.
        slowest: The least share of the speed that the robot has without things around it, on straight ways.
    """

    straight: int
    curved: int
    locked: int
    stuck: list[str]
    slowest: float


def leave_margin(guard: Guard, free: Guard, oracle: Oracle, count: int, generator: np.random.Generator) -> Leaving:
    """Starts in configurations that are nearer to something than the margin, and tries to get away.

    Straight ways are asked for at once, by a target at their end; on the others, the robot follows `Guard.way_out`.

    Args:
        guard: A guard of the policy `limit`.
        free: The same without checks of distances.
        count: How many configurations.
    """
    straight = curved = locked = 0
    stuck, slowest = list[str](), 1.0
    while straight + curved + locked + len(stuck) < count:
        q = generator.uniform(LOWER, UPPER)
        distances = oracle.distances(q)
        if not 0.0 < distances.min() < MARGIN_M:
            continue
        way = _straight_way(oracle, q, generator)
        if way is not None:
            commands, speed = (_drive(each, q, q + way) for each in (guard, free))
            share = float(np.abs(np.diff(commands, axis=0)).max() / np.abs(np.diff(speed, axis=0)).max())
            slowest = min(slowest, share)
            fault = _fault(oracle, commands)
            if fault or not oracle.distances(commands[-1]).min() > MARGIN_M:
                stuck.append(f"{q} along {way}: {fault or 'stood'}")
            straight += fault is None and oracle.distances(commands[-1]).min() > MARGIN_M
            continue
        commands = _follow(guard, q)
        fault = _fault(oracle, commands)
        if fault is None and _gets_out(guard, oracle, commands):
            curved += 1
        elif fault is None and (out := guard.way_out()) and out.is_locked and _is_locked(oracle, commands[-1]):
            locked += 1
        else:
            stuck.append(f"{q} to {commands[-1]}: {fault or 'stood'}")
    return Leaving(straight, curved, locked, stuck, slowest)


def _drive(guard: Guard, start: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Returns what is commanded when a robot that stands is sent to a target, from the first command to the last."""
    guard.halt()
    guard.start()
    situation = Situation(measured=dict(zip(guard.joint_names, start.tolist())), obstacles=OBSTACLES)
    guard.decide(tuple(start.tolist()), situation)
    return np.array([start, *_until_rest(guard, target)])


def _until_rest(guard: Guard, target: np.ndarray) -> list[tuple[float, ...]]:
    situation, commands = Situation(obstacles=OBSTACLES), list[tuple[float, ...]]()
    for _ in range(MOST_COMMANDS):
        decision = guard.decide(tuple(target.tolist()), situation)
        assert decision.command is not None
        if commands and decision.command == commands[-1]:
            break
        commands.append(decision.command)
    return commands


def _follow(guard: Guard, start: np.ndarray) -> np.ndarray:
    """Returns what is commanded when a robot is sent where the guard says that the way out is."""
    commands = list(_drive(guard, start, start))
    for _ in range(MOST_LEGS):
        out = guard.way_out()
        if out is None or out.direction is None:
            break
        target = np.clip(commands[-1] + LEG * out.direction, LOWER, UPPER)
        commands += [np.array(command) for command in _until_rest(guard, target)]
    return np.array(commands)


def _gets_out(guard: Guard, oracle: Oracle, commands: np.ndarray) -> bool:
    """Returns whether the robot got out of the margin, or does so along what is in the way to targets all around."""
    if oracle.distances(commands[-1]).min() > MARGIN_M:
        return True
    for angle in np.arange(AROUND) * 2.0 * math.pi / AROUND:
        target = np.clip(commands[0] + 0.5 * np.array((math.cos(angle), math.sin(angle))), LOWER, UPPER)
        others = _drive(guard, commands[0], target)
        if oracle.distances(others[-1]).min() > MARGIN_M and _fault(oracle, others) is None:
            return True
    _drive(guard, commands[-1], commands[-1])
    return False


def _straight_way(oracle: Oracle, q: np.ndarray, generator: np.random.Generator) -> np.ndarray | None:
    """Returns a straight way out on which no pair that is inside its margin comes nearer, and no other one comes in.

    Of those that are found it is the one that leads away the least at first.
    """
    angles = generator.uniform(-math.pi, math.pi, 96)
    ways = np.repeat((0.1, 0.2, 0.4, 0.8), 24)[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    ways = ways[((q + ways > LOWER) & (q + ways < UPPER)).all(axis=1)]
    now = _distances_on(oracle, [q])
    first = _distances_on(oracle, q + 0.002 * ways / np.linalg.norm(ways, axis=1)[:, None]) - now
    order = np.argsort(first.sum(axis=1))
    for way in ways[[i for i in order if first[i].min() >= 0.0]]:
        if oracle.distances(q + way).min() >= 1.1 * MARGIN_M:
            shares = np.linspace(0.0, 1.0, 1 + math.ceil(np.abs(way).max() / 0.005))
            if (np.diff(_distances_on(oracle, q + shares[:, None] * way), axis=0) >= 0.0).all():
                return way
    return None


def _distances_on(oracle: Oracle, rows: Sequence[np.ndarray]) -> np.ndarray:
    """Returns distances in k configurations, those beyond the margin as the margin [m]."""
    return np.minimum([oracle.distances(row) for row in rows], MARGIN_M)


def _fault(oracle: Oracle, commands: np.ndarray) -> str | None:
    """Returns by how much a pair comes nearer than it was at first and than its margin, None if none does."""
    distances = _distances_on(oracle, commands)
    nearer = distances[0] - distances
    is_allowed = nearer <= np.where(distances[0] < MARGIN_M, NEARER_M, BETWEEN_M)
    return None if is_allowed.all() else f"nearer by {1e6 * nearer[~is_allowed].max():.3g} um"


def _is_locked(oracle: Oracle, q: np.ndarray) -> bool:
    """Returns whether a small motion in none of many directions takes all that is inside the margin further apart.

    It is as `safe_robot.way_out` has it: by a share of how fast each can go apart by itself, and nothing else comes in.
    Since both measure that over a step, the oracle asks for some more.
    """
    now = oracle.distances(q)
    is_inside = now < MARGIN_M
    angles = np.arange(720) * math.pi / 360.0
    after = np.array([oracle.distances(q + STEP * way) for way in np.stack((np.cos(angles), np.sin(angles)), axis=1)])
    gains = (after - now)[:, is_inside]
    is_good = (gains > CLEAR * SLIGHT * gains.max(axis=0)).all(axis=1) & (after[:, ~is_inside] >= MARGIN_M).all(axis=1)
    return not is_good.any()


def main() -> int:
    """Runs from the command line; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=100_000, help="for each policy")
    parser.add_argument("--states", type=int, default=1_000, help="states inside the margin")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("out"))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    path = options.folder / "fuzzed.urdf"
    path.write_text(URDF)
    is_safe = True
    print("| policy | targets | commands | not safe | velocity | acceleration | jerk | nearest | brakings | faults |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for policy in ("reject", "limit"):
        generator = np.random.default_rng(options.seed)
        report = fuzz(guard_of(str(path), policy), Oracle(str(path)), options.targets, generator)
        shares = " | ".join(f"{report.worst[key]:.6f}" for key in LIMITS)
        print(
            f"| `{policy}` | {report.targets} | {report.commands} | {report.refused} | {shares}"
            f" | {1e3 * report.nearest_m:.1f} mm | {report.brakings} | {len(report.faults)} |",
            *report.faults[:5],
            sep="\n",
            flush=True,
        )
        is_safe &= not report.faults
    oracle = Oracle(str(path))
    guard, free = guard_of(str(path), "limit"), guard_of(str(path), "limit", around=False)
    left = leave_margin(guard, free, oracle, options.states, np.random.default_rng(options.seed))
    print(
        f"{options.states} states inside the margin: {left.straight} left it on straight ways, at {left.slowest:.1%} of"
        f" the speed or more, {left.curved} on others; {left.locked} are locked; {len(left.stuck)} stuck",
        *left.stuck[:20],
        sep="\n",
    )
    return 0 if is_safe and not left.stuck else 1


if __name__ == "__main__":
    sys.exit(main())
