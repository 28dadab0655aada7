"""Plans in generated scenes: share of solved queries, times, lengths, and hits that an independent check finds.

The oracle is PyBullet: it places the robots at each sample of a timed curve, and counts contacts. It shares neither
shapes nor distances nor kinematics with the planner.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet
import pybullet_data
from result import Result, Target

from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from rpbi.world import World
from rpbi_planning import JointGoal, PlannedTrajectory, PlanningScene, plan
from rpbi_planning.certify import guard_of
from rpbi_planning.collision import CollisionModel
from rpbi_planning.foresee import execute
from rpbi_planning.group import Group
from rpbi_planning.planner import length
from safe_robot.check import CheckContext

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(pybullet_data.getDataPath())
LWR = ROOT / "src/rpbi_examples/robots/kuka_lwr.urdf"
PANDA, IIWA = DATA / "franka_panda/panda.urdf", DATA / "kuka_iiwa/model.urdf"
KINDS = ("shelves", "cage", "clutter", "two arms")
SEED = 470_000
"""Seed of the scenes that are reported. Scenes with other seeds were used to develop the planner."""
SCENES, QUICK_SCENES = 5, 1
"""Number of scenes of each kind."""
QUERIES, QUICK_QUERIES = 50, 3
"""Number of queries in each scene."""
LONGEST_S, QUICK_LONGEST_S = 60.0, 10.0
"""Time after which a query counts as one without a solution, if no planner finds one [s]."""
PADDING_M = 0.005
"""Padding of the scenes; the oracle has an error of 1 to 2 mm, since it rounds edges."""
FINE_STEP, STEP = 1e-4, 1e-3
"""Largest motion of a joint between two samples of the oracle [rad]: in `FINE_QUERIES` of each scene, and in others."""
FINE_QUERIES = 5
"""Number of queries in each scene whose curves the oracle samples finely: a curve takes it some 10 s."""
COMPARED_S = 10.0
"""Time of AORRTC for a path whose length is compared [s]."""
CHECKS, QUICK_CHECKS = 5000, 500
LEAST_1_S, LEAST_5_S = Target(95.0, True), Target(99.0, True)
FORESEEN, QUICK_FORESEEN = 100, 5
"""Number of motions that are foreseen in a fork, and then executed."""
PANDA_WORLD = ROOT / "src/rpbi_examples/configs/basic_example_panda/config.yaml"


class Query(NamedTuple):
    """A start and a goal of all joints of a scene."""

    start: np.ndarray
    goal: np.ndarray


class BenchScene(NamedTuple):
    """A generated scene."""

    kind: str
    scene: PlanningScene
    group: Group
    queries: list[Query]


def scenes(count: int, queries: int, seed: int = SEED) -> Iterator[BenchScene]:
    """Yields `count` scenes of each kind, each with random queries between free configurations."""
    for kind in KINDS:
        for number in range(count):
            yield make_scene(kind, seed + 100 * KINDS.index(kind) + number, queries)


def make_scene(kind: str, seed: int, queries: int) -> BenchScene:
    """Makes a scene with random measures."""
    random = np.random.default_rng(seed)
    scene = PlanningScene(PADDING_M, 0.002)
    if kind == "two arms":
        for name, y in (("left", 0.35), ("right", -0.35)):
            scene.add_robot(name, str(IIWA), Pose((0.0, y, 0.0)))
        boxes = _clutter(random, 6, 0.5)
    else:
        robot = (LWR, PANDA)[seed % 2]
        joints = [] if robot == LWR else [f"panda_joint{i}" for i in range(1, 8)]
        scene.add_robot("arm", str(robot), joint_names=joints)
        boxes = {"shelves": _shelves, "cage": _cage, "clutter": lambda each: _clutter(each, 14, 0.3)}[kind](random)
    for i, (size, position, yaw) in enumerate(boxes):
        pose = Pose(tuple(position), (0.0, 0.0, float(np.sin(yaw / 2.0)), float(np.cos(yaw / 2.0))))
        scene.add(Obstacle(f"box_{i}", "box", tuple(map(float, size)), pose))
    group = Group(scene, list(scene.robots))
    model = CollisionModel(scene, group)
    free = _free(random, model)
    return BenchScene(kind, scene, group, [Query(next(free), next(free)) for _ in range(queries)])


def _free(random: np.random.Generator, model: CollisionModel) -> Iterator[np.ndarray]:
    while True:
        q = random.uniform(model.group.lower, model.group.upper)
        if model.is_free(q):
            yield q


Boxes = list[tuple[Any, Any, float]]


def _shelves(random: np.random.Generator) -> Boxes:
    """Two shelves with boards, side walls and a back, in front of and next to the robot."""
    boxes: Boxes = []
    for yaw in (0.0, np.pi / 2.0):
        far, width, depth = random.uniform(0.55, 0.7), random.uniform(0.6, 0.9), random.uniform(0.25, 0.35)
        turn = np.array(((np.cos(yaw), -np.sin(yaw), 0.0), (np.sin(yaw), np.cos(yaw), 0.0), (0.0, 0.0, 1.0)))
        parts = [((depth, width, 0.02), (far, 0.0, z)) for z in np.cumsum(random.uniform(0.25, 0.4, 4))]
        parts += [((depth, 0.02, 1.4), (far, side * width / 2.0, 0.7)) for side in (-1.0, 0.0, 1.0)]
        parts.append(((0.02, width, 1.4), (far + depth / 2.0, 0.0, 0.7)))
        boxes += [(size, turn @ np.array(at), yaw) for size, at in parts]
    return boxes


def _cage(random: np.random.Generator) -> Boxes:
    """Posts on a circle around the robot, and bars across it."""
    count, radius = int(random.integers(6, 9)), random.uniform(0.45, 0.6)
    angles = 2.0 * np.pi * (np.arange(count) + random.uniform(0.0, 1.0)) / count
    boxes: Boxes = [
        ((0.04, 0.04, 1.3), (radius * np.cos(angle), radius * np.sin(angle), 0.65), float(angle)) for angle in angles
    ]
    boxes += [((2.0 * radius, 0.04, 0.04), (0.0, y, random.uniform(1.15, 1.3)), 0.0) for y in (-0.25, 0.25)]
    return boxes


def _clutter(random: np.random.Generator, count: int, least: float) -> Boxes:
    """Boxes of random sizes at random places, not within `least` of the axis of a robot [m]."""
    boxes: Boxes = []
    while len(boxes) < count:
        at = random.uniform((-0.9, -0.9, 0.0), (0.9, 0.9, 1.1))
        if np.hypot(at[0], at[1]) > least + 0.1 or (least < 0.4 and at[2] > 1.0):
            boxes.append((random.uniform(0.05, 0.3, 3), at, float(random.uniform(0.0, np.pi))))
    return boxes


class Oracle:
    """Counts contacts of robots in PyBullet, without any code of the planner.

    Pairs of links of one robot that touch at a start or goal are not counted: their shapes overlap by construction.
    PyBullet leaves out neighbouring links by itself.
    """

    def __init__(self, made: BenchScene) -> None:
        self._pb = pybullet.connect(pybullet.DIRECT)
        self._robots, self._columns = list[int](), list[tuple[int, int, int]]()
        on = {"physicsClientId": self._pb}
        flags = pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT
        for robot in made.scene.robots.values():
            body = pybullet.loadURDF(robot.model.urdf_path, *robot.base, useFixedBase=True, flags=flags, **on)
            self._robots.append(body)
            joints = range(pybullet.getNumJoints(body, **on))
            names = {pybullet.getJointInfo(body, i, **on)[1].decode(): i for i in joints}
            many = len(made.scene.robots) > 1
            for column, name in enumerate(made.group.joint_names):
                if not many or name.startswith(f"{robot.name}/"):
                    self._columns.append((body, names[name.split("/")[-1]], column))
        for name, (box, *_) in made.scene.bodies.items():
            half = [each / 2.0 for each in box.size]
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, **on)
            pybullet.createMultiBody(0.0, shape, -1, *made.scene.poses[name], **on)
        self._ignored = set[tuple[int, int, int, int]]()
        touching = {pair for query in made.queries for q in query for pair in self._touching(q)}
        self._ignored = {pair for pair in touching if pair[0] == pair[1]}

    def _touching(self, q: np.ndarray) -> set[tuple[int, int, int, int]]:
        for body, joint, column in self._columns:
            pybullet.resetJointState(body, joint, q[column], physicsClientId=self._pb)
        pybullet.performCollisionDetection(self._pb)
        return {
            point[1:5]
            for body in self._robots
            for point in pybullet.getContactPoints(bodyA=body, physicsClientId=self._pb)
            if point[8] < 0.0 and not (point[3] == -1 and point[2] not in self._robots)
        }

    def hits(self, curve: np.ndarray) -> int:
        """Returns the number of configurations in which a robot touches something."""
        return sum(bool(self._touching(q) - self._ignored) for q in curve)

    def checks_per_s(self, curve: np.ndarray, distance_m: float) -> float:
        """Returns how many configurations a second PyBullet's `getClosestPoints` checks, per second of processor."""
        others = [body for body in range(pybullet.getNumBodies(self._pb)) if body not in self._robots]
        begin = time.process_time()
        for q in curve:
            for body, joint, column in self._columns:
                pybullet.resetJointState(body, joint, q[column], physicsClientId=self._pb)
            for body in self._robots:
                for other in (*others, *self._robots):
                    pybullet.getClosestPoints(body, other, distance_m, physicsClientId=self._pb)
        return len(curve) / (time.process_time() - begin)

    def close(self) -> None:
        pybullet.disconnect(self._pb)


def dense(trajectory: PlannedTrajectory, step: float) -> np.ndarray:
    """Samples a curve so that no joint moves by more than about `step` between two samples [rad or m]."""
    speed = max(float(np.abs(trajectory.velocities).max()), 1e-6)
    return trajectory.at(np.linspace(0.0, trajectory.duration_s, int(speed * trajectory.duration_s / step) + 2))


def passed_limits(group: Group, trajectory: PlannedTrajectory) -> int:
    """Counts samples of a curve, by finite differences of its positions, that pass a limit by more than 0.1 %."""
    dt = 1e-3
    q = trajectory.at(np.arange(-3.0, trajectory.duration_s / dt + 4.0) * dt)
    count = int(((q < group.lower - 1e-9) | (q > group.upper + 1e-9)).any(axis=1).sum())
    for order, limit in ((1, group.velocity), (2, group.acceleration), (3, group.jerk)):
        rates = np.abs(np.diff(q, order, axis=0)) / dt**order
        count += int((rates > 1.001 * limit + 1e-12 / dt**order).any(axis=1).sum())
    return count


def stopped_by_guard(made: BenchScene, trajectory: PlannedTrajectory) -> bool:
    """Returns whether a guard with a period of 10 ms stops a motion."""
    for r, robot in enumerate(made.group.robots):
        guard = guard_of(made.scene, robot, 0.0, 0.01)
        guard.start()
        context = CheckContext(obstacles=made.scene.obstacles_for(robot.name))
        for q in made.group.full(trajectory.sampled(0.01), r):
            if guard.decide(tuple(q.tolist()), context).violation is not None:
                return True
    return False


class Tally:
    """Figures of all queries of one kind."""

    def __init__(self) -> None:
        self.total = self.solvable = self.in_1_s = self.in_5_s = 0
        self.hits = self.unproven_hits = self.limits = self.stops = 0
        self.path_s: list[float] = []
        self.timed_s: list[float] = []
        self.path_processor_s: list[float] = []
        self.timed_processor_s: list[float] = []
        self.ratios: list[float] = []


def run(quick: bool) -> list[Result]:
    """Plans for all queries of all scenes, and lets the oracle look at each timed curve.

    Args:
        quick: Whether a few scenes, queries and samples will do.
    """
    count, queries = (QUICK_SCENES, QUICK_QUERIES) if quick else (SCENES, QUERIES)
    longest_s = QUICK_LONGEST_S if quick else LONGEST_S
    tallies = {kind: Tally() for kind in KINDS}
    ours, theirs = [], []
    for made in scenes(count, queries):
        oracle = Oracle(made)
        _measure(made, oracle, tallies[made.kind], longest_s, quick)
        random = np.random.default_rng(1)
        sampled = random.uniform(made.group.lower, made.group.upper,
                                 (QUICK_CHECKS if quick else CHECKS, len(made.group.lower)))  # fmt: skip
        model = CollisionModel(made.scene, made.group)
        begin = time.process_time()
        for q in sampled:
            model.is_free(q)
        ours.append(len(sampled) / (time.process_time() - begin))
        theirs.append(oracle.checks_per_s(sampled[: len(sampled) // 5], PADDING_M))
        oracle.close()
    figure, least = "checks a second, against getClosestPoints", Target(2.5, True, True)
    checks = Result("plan", figure, statistics.median(ours), "/s", statistics.median(theirs), least)
    return [*_results(tallies), checks, _foreseen(QUICK_FORESEEN if quick else FORESEEN)]


def _foreseen(count: int) -> Result:
    """Executes motions in a world after they were foreseen in its fork, and compares the final states."""
    world = World.from_file(str(PANDA_WORLD), connection_mode=pybullet.DIRECT)
    random, same = np.random.default_rng(SEED), 0
    try:
        scene = PlanningScene.of_world(world)
        group = Group(scene, ["panda"], [f"panda_joint{i}" for i in range(1, 8)])
        for _ in range(count):
            scene.update(world)
            model = CollisionModel(scene, group)
            goal = JointGoal(dict(zip(group.joint_names, next(_free(random, model)).tolist())))
            result = plan(
                scene, "panda", goal, group=group.joint_names, foresee=world, certify=False, time_limit_s=30.0
            )
            if result.trajectory is None or result.foreseen is None:
                print(f"foreseen: {result.message}", flush=True)
                continue
            happened = execute(world, ["panda"], result.trajectory, group)
            same += happened.state_hash == result.foreseen.state_hash
    finally:
        world.close()
    return Result(
        "plan", f"foreseen states that equal the executed ones, of {count}", same, "", None, Target(count, True)
    )


def _measure(made: BenchScene, oracle: Oracle, tally: Tally, longest_s: float, quick: bool) -> None:
    robots = list(made.scene.robots)
    for number, query in enumerate(made.queries):
        for r, robot in enumerate(made.group.robots):
            robot.positions = made.group.full(query.start[None], r)[0]
        goals = {robot.name: JointGoal(made.group.full(query.goal[None], r)[0])
                 for r, robot in enumerate(made.group.robots)}  # fmt: skip
        tally.total += 1
        begin = time.perf_counter()
        result = plan(made.scene, robots, goals, time_limit_s=longest_s, seed=number)
        if not result.success:
            others = (plan(made.scene, robots, goals, planner=name, time_limit_s=longest_s / 2.0, seed=number)
                      for name in ("bit_star", "prm"))  # fmt: skip
            solvable = "time limit" not in result.message or any(each.success for each in others)
            tally.solvable += solvable
            print(f"{made.kind}: query {number}: {result.message}, {time.perf_counter() - begin:.1f} s", flush=True)
            continue
        times, spent = result.times_s, result.processor_s
        to_path, path_processor = (sum(each[key] for key in ("scene", "goals", "planning")) for each in (times, spent))
        tally.solvable += 1
        tally.in_1_s += path_processor <= 1.0  # on one core, whatever else the computer does
        tally.in_5_s += path_processor <= 5.0
        tally.path_s.append(to_path)
        tally.timed_s.append(to_path + times["shortening"] + times["timing"])
        tally.path_processor_s.append(path_processor)
        tally.timed_processor_s.append(tally.path_processor_s[-1] + spent["shortening"] + spent["timing"])
        assert result.trajectory is not None
        step = STEP if quick or number >= FINE_QUERIES else FINE_STEP
        tally.hits += oracle.hits(dense(result.trajectory, step)) > 0
        straight = query.start + np.linspace(0.0, 1.0, 500)[:, None] * (query.goal - query.start)
        tally.unproven_hits += oracle.hits(straight) > 0
        tally.limits += passed_limits(made.group, result.trajectory)
        tally.stops += stopped_by_guard(made, result.trajectory)
        if number < 2 and not (quick and number) and len(result.path) > 2:
            best = plan(made.scene, robots, goals, planner="aorrtc", time_limit_s=COMPARED_S, shorten_s=0.0,
                        seed=number, certify=False)  # fmt: skip
            if best.success:
                tally.ratios.append(length(result.path) / length(best.path))


def _results(tallies: dict[str, Tally]) -> list[Result]:
    found = []

    def add(kind: str, figure: str, value: float, unit: str = "", target: Target | None = None) -> None:
        found.append(Result("plan", f"{kind}: {figure}", value, unit, None, target))

    for kind, each in tallies.items():
        share = 100.0 / max(each.solvable, 1)
        add(
            kind,
            f"solved within 1 s of processor time, of {each.solvable} solvable of {each.total}",
            share * each.in_1_s,
            "%",
            LEAST_1_S,
        )
        add(kind, "solved within 5 s of processor time", share * each.in_5_s, "%", LEAST_5_S)
        for steps, wall, processor, most in (
            ("to a proven path", each.path_s, each.path_processor_s, Target(100.0)),
            ("to a shortened and timed one", each.timed_s, each.timed_processor_s, Target(400.0)),
        ):
            add(kind, f"{steps}, median", 1e3 * statistics.median(wall or [np.inf]), "ms", most)
            add(kind, f"{steps}, median of processor time", 1e3 * statistics.median(processor or [np.inf]), "ms")
        add(kind, "timed curves that hit", each.hits, "", Target(0.0))
        add(kind, "straight motions that hit (control)", each.unproven_hits)
        add(kind, "samples beyond a limit", each.limits, "", Target(0.0))
        add(kind, "motions that the guard stops", each.stops, "", Target(0.0))
        if each.ratios:
            add(kind, "length over that of AORRTC in 10 s", statistics.mean(each.ratios), "", Target(1.15))
    return found
