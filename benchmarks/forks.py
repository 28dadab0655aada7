"""Whether saved, restored and forked worlds go on as the world itself, and how long a prediction takes."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from bench_worlds import arm_world
from random_resets import exact_resets
from result import Result, Target
from session import JOINT_STATES, Session

SUPPORT = Path(__file__).resolve().parent.parent / "tests/support"
sys.path += (support := [str(SUPPORT / each) for each in ("worlds", "robots")])
os.environ["PYTHONPATH"] = os.pathsep.join((os.environ.get("PYTHONPATH", ""), *support))  # of forks
import sleeping_session as script  # noqa: E402
import streaming_session  # noqa: E402

from rpbi.geometry import Pose, Twist  # noqa: E402
from rpbi.world import World  # noqa: E402
from rpbi.world.loading import load_world  # noqa: E402

SEEDS, QUICK_SEEDS = 200, 5
FIRST_SEED = 5000
"""Seeds from here on were not used before."""
FIRST_KEYFRAME_SEED = 9000
RESETS = 1000
SHORTEST, LONGEST, AHEAD = 100, 900, 500
"""Ticks before a state is saved, and after."""
SINCE, ON = 200, 300
"""Ticks with further commands between a keyframe and the state, and ticks with a candidate's inputs after it."""
Inputs = Mapping[str, Callable[[np.random.Generator], Any]]
"""What makes a value, by input that always takes one."""
DRIVEN: Inputs = {
    "mobile/cmd_vel": lambda random: Twist((*random.uniform(-1.0, 1.0, 2).tolist(), 0.0), (0.0, 0.0, 0.5)),
    "follower/pose": lambda random: Pose(tuple(random.uniform((0.3, -0.3, 0.0), (0.6, 0.3, 0.3)).tolist())),
}
STREAMED: Inputs = {
    "gripper/target": lambda random: {"left": float(random.uniform(0.01, 0.05))},
    "seen/pose": lambda random: Pose((0.5, float(random.uniform(-0.62, -0.58)), 0.12)),
    "eye/pose": lambda random: Pose((float(random.uniform(0.3, 0.7)), 0.0, 2.0), streaming_session.LOOKS_DOWN),
}
ASLEEP = 0.4
"""Smallest share of worlds in which a body sleeps when they are saved."""
KUKA = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
ROBOT, TARGET = "kuka_lwr", "kuka_lwr/target"
CANDIDATES, TICKS = 8, 200
CHOSEN, QUICK_CHOSEN = 100, 5
LARGEST_S = 0.2
PREPARED_S = 2.0
"""Time between the start of the process that forks, and the first prediction."""
OLD_S, QUICK_OLD_S = 3600.0, 20.0
"""Age of a world with a target at every tick [s]."""
KEYFRAME_S = 5.0
"""Period of its keyframes [s]."""
MOST_S, MOST_PAUSE_S = 1.0, 0.05
"""Largest time to restore, fork and predict; largest processor time of a part of a keyframe [s]."""
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
        *_keyframes("sleeping", script.SleepingScript, script.build, DRIVEN, seeds),
        *_keyframes("streaming", streaming_session.Script, streaming_session.build, STREAMED, seeds),
        *exact_resets(range(QUICK_SEEDS if quick else RESETS)),
        *_old(QUICK_OLD_S if quick else OLD_S, 0.001),
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
    """Returns whether a body sleeps when a session is saved, and by way whether it goes on in the same way."""
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
    """Predicts candidates, takes one of them, and compares what happens with its prediction."""
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


def _keyframes(name: str, make: Any, build: Any, inputs: Inputs, seeds: int) -> list[Result]:
    """Compares worlds that go on after a keyframe with the running one: by hashes, some by all samples too."""
    same = dict.fromkeys(("from_state", "fork", "prediction", "restore"), 0)
    for seed in range(FIRST_KEYFRAME_SEED, FIRST_KEYFRAME_SEED + seeds):
        with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
            world = build(Path(folder), seed)
            for way, is_same in _after_keyframe(world, make(seed), inputs, seed).items():
                same[way] += is_same
                if not is_same:
                    print(f"keyframes, {name} session {seed}: {way} differs", file=sys.stderr)
            world.close()
    what = f"{SINCE} ticks after keyframes of {name} sessions"
    return [
        Result("forks", f"{what}, {way}: equal, of {seeds}", count, "", None, Target(seeds, at_least=True))
        for way, count in same.items()
    ]


def _after_keyframe(world: World, script: Any, inputs: Inputs, seed: int) -> dict[str, bool]:
    """Makes a keyframe, goes on with further commands, and returns by way whether it goes on in the same way."""
    random = np.random.default_rng(seed)
    for tick in range(ticks := int(random.integers(SHORTEST, LONGEST)) + SINCE):
        if tick == ticks - SINCE:
            world.keyframe()
        script.act(world)
        world.step()
    state = world.save()
    candidate = [(tick, slot, make(random)) for tick in range(0, ON, 50) for slot, make in inputs.items()]
    with _second_thread():  # so that forks are those of a program of its own, which starts at the keyframe
        (prediction,) = world.predict([candidate], ON)
        with world.fork()[0] as fork:
            forked = _go_on(candidate, fork.put, fork.step), fork.state_hash()
    samples, expected = _go_on(candidate, world.put, world.step), world.state_hash()
    same = {"fork": forked == (samples, expected), "prediction": prediction.state_hash == expected}
    other = World.from_state(state)
    same["from_state"] = _go_on(candidate, other.put, other.step) == samples and other.state_hash() == expected
    other.close()
    world.restore(state)
    _go_on(candidate, world.put, world.step)
    same["restore"] = world.state_hash() == expected
    return same


def _go_on(candidate: list[Any], put: Any, step: Any) -> list[Any]:
    """Steps with the inputs of a candidate, and returns all samples."""
    samples = []
    for tick in range(ON):
        for planned, slot, value in candidate:
            if planned == tick:
                put(slot, value)
        samples += step()
    return samples


@contextmanager
def _second_thread() -> Iterator[None]:
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _old(seconds: float, dt_s: float) -> list[Result]:
    """Restores, forks and predicts a world of a certain age just before its next keyframe, and times keyframes."""
    random = np.random.default_rng(FIRST_SEED)
    gc.collect()
    gc.freeze()  # as the node does: a collection of all objects of this process would be the longest part
    world = World(load_world(KUKA, overrides={"timeStep": dt_s}))
    ticks, period, pauses = round(seconds / dt_s), round(KEYFRAME_S / dt_s), []
    for tick in range(ticks + period - 1):
        world.put(TARGET, {"lwr_arm_0_joint": float(random.uniform(-0.5, 0.5))})
        world.step()
        if (tick + 1) % period == 0:
            parts, longest_s, is_over = world.keyframe_in_parts(), 0.0, False
            while not is_over:
                begin_s = time.thread_time()
                is_over = next(parts, parts) is parts
                longest_s = max(longest_s, time.thread_time() - begin_s)
            pauses.append(longest_s)
    durations = {}
    state = world.save()
    for what, ask in (
        ("restore", lambda: world.restore(state)),
        ("World.from_state", lambda: World.from_state(state).close()),
        ("fork", lambda: world.fork()[0].close()),
        ("predict 200 ticks", lambda: world.predict([[]], TICKS)),
    ):
        begin_s = time.perf_counter()
        ask()
        durations[what] = time.perf_counter() - begin_s
    world.close()
    what = f"the KUKA at {1.0 / dt_s:g} Hz after {seconds:g} s"
    aged = f"{what} of targets, {KEYFRAME_S:g} s after its last keyframe"
    return [
        Result("forks", f"{what}: longest part of a keyframe, median", float(np.median(pauses)), "s"),
        Result("forks", f"{what}: longest part of {len(pauses)}", max(pauses), "s", None, Target(MOST_PAUSE_S)),
        *(Result("forks", f"{aged}: {way}", taken_s, "s", None, Target(MOST_S)) for way, taken_s in durations.items()),
    ]


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
