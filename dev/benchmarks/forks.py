"""Checks that saved, restored and forked worlds continue like the original world; measures the time of a prediction."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from bench_worlds import arm_world
from random_resets import exact_resets
from result import Result, Target
from session import JOINT_STATES, Session

SUPPORT = Path(__file__).resolve().parents[2] / "tests/support"
sys.path += (support := [str(SUPPORT / each) for each in ("worlds", "robots")])
os.environ["PYTHONPATH"] = os.pathsep.join((os.environ.get("PYTHONPATH", ""), *support))  # of forks
import sleeping_session as script  # noqa: E402

from rpbi.world import World  # noqa: E402

SEEDS, QUICK_SEEDS = 200, 5
FIRST_SEED = 5000
"""Seeds from here on were not used before."""
RESETS = 1000
SHORTEST, LONGEST, AHEAD = 100, 900, 500
"""Ticks before a state is saved, and after."""
ASLEEP = 0.4
"""Smallest share of worlds in which a body sleeps when they are saved."""
KUKA = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
ROBOT, TARGET = "kuka_lwr", "kuka_lwr/target"
CANDIDATES, TICKS = 8, 200
CHOSEN, QUICK_CHOSEN = 100, 5
LARGEST_S = 0.2
PREPARED_S = 2.0
"""Time between the start of the process that forks, and the first prediction."""
SAVED_S = 10
"""Time with a target at every tick before a save [s]."""
BESIDE_S, QUICK_BESIDE_S = 20.0, 5.0
HZ, LEAST_HZ = 1000.0, 998.0
ELSEWHERE = (
    "import sys; from rpbi.world import World; world = World.from_state(sys.argv[1])\n"
    "for _ in range(int(sys.argv[2])): world.step()\n"
    "print('hash:', world.state_hash())"
)


def run(quick: bool) -> list[Result]:
    """Compares random sessions in contact by their hashes, and predicts for an arm that pushes a box."""
    seeds = QUICK_SEEDS if quick else SEEDS
    return [
        *_predictions(QUICK_CHOSEN if quick else CHOSEN),  # while this process is as large as a script is
        *_exact(seeds),
        *_saves(),
        *exact_resets(range(QUICK_SEEDS if quick else RESETS)),
        *_beside_a_node(QUICK_BESIDE_S if quick else BESIDE_S),
    ]


def _exact(seeds: int) -> list[Result]:
    same = dict.fromkeys(("same process", "fork", "another process", "PyBullet's own saveState"), 0)
    asleep = 0
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        sleeps, ways = _session(seed)
        asleep += sleeps
        for way, is_same in ways.items():
            same[way] += is_same
    control = same.pop("PyBullet's own saveState")
    share = Target(ASLEEP * seeds, at_least=True)
    return [
        Result("forks", f"worlds in which a body sleeps when they are saved, of {seeds}", asleep, "", None, share),
        *(
            Result("forks", f"{way}: equal {AHEAD} ticks on, of {seeds}", count, "", None, Target(seeds, at_least=True))
            for way, count in same.items()
        ),
        Result("forks", f"control, PyBullet's own saveState: equal, of {seeds}", control, ""),
    ]


def _session(seed: int) -> tuple[bool, dict[str, bool]]:
    """Returns whether a body sleeps when a session is saved, and by method whether it continues identically."""
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        world = script.build(Path(folder), seed)
        script.run(world, seed, int(np.random.default_rng(seed).integers(SHORTEST, LONGEST)))
        file = Path(folder) / "here.world"
        state = world.save(file)
        fork, other = world.fork(2)
        with fork, other:
            fork.step(AHEAD)
            hashes = {"fork": fork.state_hash()}
            sleeps = bool(other.call(script.sleeping))
        saved = world.pb.saveState()
        expected = _hash_later(world)
        command = [sys.executable, "-c", ELSEWHERE, str(file), str(AHEAD)]
        printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        hashes["another process"] = printed.partition("hash: ")[2].split()[0]
        world.pb.restoreState(saved)
        world.clock.tick -= AHEAD
        hashes["PyBullet's own saveState"] = _hash_later(world)
        world.restore(state)
        hashes["same process"] = _hash_later(world)
        world.close()
    return sleeps, {way: found == expected for way, found in hashes.items()}


def _hash_later(world: World) -> str:
    for _ in range(AHEAD):
        world.step()
    return world.state_hash()


def _predictions(chosen: int) -> list[Result]:
    """Predicts candidates, executes one of them, and compares the result with its prediction."""
    random, durations, same = np.random.default_rng(FIRST_SEED), [], 0
    cold_s, prepared_s = _first(random, 0.0), _first(random, PREPARED_S)
    world = World.from_file(KUKA)
    world.prepare_forks()
    time.sleep(PREPARED_S)
    for _ in range(300):
        world.step()
    for _ in range(chosen):
        candidates = [_candidate(random) for _ in range(CANDIDATES)]
        begin_s = time.perf_counter()
        predictions = world.predict(candidates, TICKS, watch=[ROBOT, "box"])
        durations.append(time.perf_counter() - begin_s)
        taken = int(random.integers(CANDIDATES))
        _take(world, candidates[taken])
        same += world.state_hash() == predictions[taken].state_hash
    world.close()
    what = f"{CANDIDATES} candidates x {TICKS} ticks of the KUKA"
    return [
        Result("forks", f"chosen candidate as predicted, of {chosen}", same, "", None, Target(chosen, at_least=True)),
        Result("forks", f"{what}: median", float(np.median(durations)), "s", None, Target(LARGEST_S)),
        Result("forks", f"{what}: longest", max(durations), "s", None, Target(LARGEST_S)),
        Result("forks", f"the first one, prepared {PREPARED_S:g} s before", prepared_s, "s", None, Target(LARGEST_S)),
        Result("forks", "the first one, not prepared", cold_s, "s", None, Target(LARGEST_S)),
    ]


def _first(random: np.random.Generator, prepared_s: float) -> float:
    """Returns the time of the first prediction of a world [s], which was prepared some time before, if at all."""
    world = World.from_file(KUKA)
    if prepared_s:
        world.prepare_forks()
        time.sleep(prepared_s)
    for _ in range(300):
        world.step()
    candidates = [_candidate(random) for _ in range(CANDIDATES)]
    begin_s = time.perf_counter()
    world.predict(candidates, TICKS, watch=[ROBOT, "box"])
    taken_s = time.perf_counter() - begin_s
    world.close()
    return taken_s


def _saves() -> list[Result]:
    """Saves a world after some seconds with a target at every tick."""
    random, world = np.random.default_rng(FIRST_SEED), World.from_file(KUKA)
    for _ in range(round(SAVED_S / world.clock.dt_s)):
        world.put(TARGET, {"lwr_arm_0_joint": float(random.uniform(-0.5, 0.5))})
        world.step()
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        file = Path(folder) / "here.world"
        begin_s = time.perf_counter()
        world.save(file)
        taken_s = time.perf_counter() - begin_s
        size = file.stat().st_size
    what = f"save after {SAVED_S} s, {world.commands.count} targets"
    world.close()
    return [Result("forks", f"{what}: time", taken_s, "s"), Result("forks", f"{what}: file", size / 1000, "kB")]


def _beside_a_node(seconds: float) -> list[Result]:
    """Counts the joint states of a running simulator while it is asked for predictions all the time."""
    with Session() as ros:
        ros.simulator(arm_world(ros.folder, HZ))
        asking = ros.program("predict_often", CANDIDATES, TICKS, 2.0 + seconds)
        ros.wait_for_output(asking, "ready")
        states = ros.watch(JOINT_STATES, seconds=seconds, stock=False).arrivals()[JOINT_STATES]
        durations = ros.result_of(asking)
    what = f"beside a node at {HZ:g} Hz, {CANDIDATES} candidates x {TICKS} ticks"
    return [
        Result("forks", f"{what}: joint states", states.rate_hz, "Hz", None, Target(LEAST_HZ, at_least=True)),
        Result("forks", f"{what}: median", float(np.median(durations)), "s"),
        Result("forks", f"{what}: longest", max(durations), "s"),
    ]


def _candidate(random: np.random.Generator) -> list[tuple[int, str, dict[str, float]]]:
    joints = [f"lwr_arm_{index}_joint" for index in (0, 1, 3)]
    goal = random.uniform((-0.5, 0.3, -1.8), (0.5, 0.9, -1.0))
    return [(20 * turn, TARGET, dict(zip(joints, (goal + 0.01 * turn).tolist()))) for turn in range(10)]


def _take(world: World, candidate: list[tuple[int, str, Any]]) -> None:
    waiting = list(candidate)
    for tick in range(TICKS):
        while waiting and waiting[0][0] <= tick:
            _, slot, value = waiting.pop(0)
            world.put(slot, value)
        world.step()
