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
from safe_robot.config import GuardConfig
from safe_robot.geometry.obstacles import Obstacle
from safe_robot.guard import Guard
from safe_robot.robot import GuardedRobot

PERIOD_S = 0.01
LIMITS = {"velocity": 1.0, "acceleration": 8.0, "jerk": 200.0}
MARGIN_M = 0.02
ROUNDING = 1e-6
"""Relative, of the oracle's differences."""
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
        for joint, position in enumerate(q):
            pybullet.resetJointState(self._robot, joint, position, physicsClientId=self._client)
        nearest = math.inf
        for a, b in PAIRS:
            nearest = min(nearest, self._distance(self._robot, a, b))
        for box in self._boxes:
            for link in (0, 1):
                nearest = min(nearest, self._distance(box, link, -1))
        if nearest <= 0.0:
            self.faults.append(f"in collision: {q}, {nearest:.3g} m")
        self.nearest_m = min(self.nearest_m, nearest)
        return nearest

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


def guard_of(urdf: str, policy: str, **limits: float) -> Guard:
    """Returns a guard of the robot, with all checks of joints and shapes; limits other than `LIMITS` are wrong."""
    checks: dict[str, Any] = {"environment": {"margin_m": MARGIN_M}, "self_collision": {"margin_m": MARGIN_M}}
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


def ways_out(guard: Guard, oracle: Oracle, count: int, generator: np.random.Generator) -> tuple[int, int]:
    """Starts in configurations that are nearer to something than the margin, and tries to get away.

    Returns:
        In how many it was tried, and in how many it did not get away.
    """
    tried = stuck = 0
    while tried < count:
        q = generator.uniform(LOWER, UPPER)
        nearest, oracle.nearest_m = oracle.place(q), math.inf
        if not 0.0 < nearest < MARGIN_M or not (way := _way_out(oracle, q)).any():
            continue
        tried += 1
        guard.halt()
        guard.start()
        names = guard.joint_names
        situation = Situation(measured=dict(zip(names, q.tolist())), obstacles=OBSTACLES)
        decision = guard.decide(tuple(q.tolist()), situation)
        for share in np.minimum(np.arange(150) / 100.0, 1.0):
            decision = guard.decide(tuple((q + share * way).tolist()), situation)
        is_away = decision.command is not None and oracle.place(decision.command) > MARGIN_M
        stuck += not is_away
        oracle.faults.clear()
    return tried, stuck


def _way_out(oracle: Oracle, q: np.ndarray) -> np.ndarray:
    """Returns a short way on which distances grow until they are more than the margin; zeros if none is found."""
    for length in (0.05, 0.1, 0.15, 0.2, 0.3):
        for angle in np.arange(32) * math.pi / 16.0:
            way = length * np.array((math.cos(angle), math.sin(angle)))
            if (q + way > LOWER).all() and (q + way < UPPER).all():
                distances = [oracle.place(q + share * way) for share in np.linspace(0.0, 1.0, 11)]
                if distances[-1] > 1.1 * MARGIN_M and (np.diff(distances) >= 0.0).all():
                    return way
    return np.zeros(2)


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
    tried, stuck = ways_out(guard_of(str(path), "limit"), oracle, options.states, np.random.default_rng(options.seed))
    print(f"{tried} states inside the margin; from {stuck} of them the robot did not get away")
    return 0 if is_safe and not stuck else 1


if __name__ == "__main__":
    sys.exit(main())
