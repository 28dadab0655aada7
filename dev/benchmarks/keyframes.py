"""Checks that worlds continue from keyframes like the running one; measures restoring after an hour, and the time of
keyframes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from result import Result, Target
from session import PROGRAMS, Session

SUPPORT = Path(__file__).resolve().parents[2] / "tests/support"
sys.path += (support := [str(SUPPORT / each) for each in ("worlds", "robots")])
os.environ["PYTHONPATH"] = os.pathsep.join((os.environ.get("PYTHONPATH", ""), *support))  # of forks
import sleeping_session  # noqa: E402
import streaming_session  # noqa: E402

from rpbi.geometry import Pose, Twist  # noqa: E402
from rpbi.world import World  # noqa: E402

SEEDS, QUICK_SEEDS = 200, 5
FIRST_SEED = 9000
REPORTED = 10
"""Number of sessions after which counts are printed, so that an interrupted run has some."""
SHORTEST, LONGEST = 100, 900
"""Ticks before a keyframe."""
SINCE, ON = 200, 300
"""Ticks with further commands between a keyframe and the state, and ticks with a candidate's inputs after it."""
HOUR_S, QUICK_HOUR_S = 3600.0, 20.0
"""Time of a world at 1 kHz with a target at each tick [s]."""
KEYFRAME_S = 2.0
"""Period of its keyframes [s]."""
MOST_S, MOST_PAUSE_S = 1.0, 0.05
"""Largest time to restore, fork and predict; longest part of a keyframe [s]."""
PAUSES, QUICK_PAUSES = 20, 5
EXAMPLE = ["roslaunch", "rpbi_examples", "basic_example_kuka_lwr.launch", "headless:=true"]
"""The world of the demo."""
SEEN = ["/tf", "/rpbi/kuka_lwr/joint_states", "/rpbi/camera/colour/image", "/rpbi/camera/depth/image"]
"""Topics of it that are recorded meanwhile."""
Inputs = Mapping[str, Callable[[np.random.Generator], Any]]
"""Functions that make a random value, by the input that takes it."""
DRIVEN: Inputs = {
    "mobile/cmd_vel": lambda random: Twist((*random.uniform(-1.0, 1.0, 2).tolist(), 0.0), (0.0, 0.0, 0.5)),
    "follower/pose": lambda random: Pose(tuple(random.uniform((0.3, -0.3, 0.0), (0.6, 0.3, 0.3)).tolist())),
}
STREAMED: Inputs = {
    "gripper/target": lambda random: {"left": float(random.uniform(0.01, 0.05))},
    "seen/pose": lambda random: Pose((0.5, float(random.uniform(-0.62, -0.58)), 0.12)),
    "eye/pose": lambda random: Pose((float(random.uniform(0.3, 0.7)), 0.0, 2.0), streaming_session.LOOKS_DOWN),
}


def run(quick: bool) -> list[Result]:
    """Compares random sessions after keyframes, and times a world of an hour and the pauses of a running one."""
    seeds = QUICK_SEEDS if quick else SEEDS
    return [
        *_sessions("sleeping", sleeping_session.SleepingScript, sleeping_session.build, DRIVEN, seeds),
        *_sessions("streaming", streaming_session.Script, streaming_session.build, STREAMED, seeds),
        *_hour(QUICK_HOUR_S if quick else HOUR_S),
        *_pauses(QUICK_PAUSES if quick else PAUSES),
    ]


def _sessions(name: str, make: Any, build: Any, inputs: Inputs, seeds: int) -> list[Result]:
    """Compares worlds that continue from a keyframe with the running one: by hashes, some also by all samples."""
    same = dict.fromkeys(("from_state", "fork", "prediction", "restore"), 0)
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
            world = build(Path(folder), seed)
            for way, is_same in _after_keyframe(world, make(seed), inputs, seed).items():
                same[way] += is_same
                if not is_same:
                    print(f"{name} session {seed}: {way} differs", file=sys.stderr)
            world.close()
        if (done := seed - FIRST_SEED + 1) % REPORTED == 0:
            counts = ", ".join(f"{way} {count}" for way, count in same.items())
            print(f"equal of {done} {name} sessions: {counts}", file=sys.stderr, flush=True)
    what = f"{SINCE} ticks after keyframes of {name} sessions"
    return [
        Result("keyframes", f"{what}, {way}: equal, of {seeds}", count, "", None, Target(seeds, at_least=True))
        for way, count in same.items()
    ]


def _after_keyframe(world: World, script: Any, inputs: Inputs, seed: int) -> dict[str, bool]:
    """Makes a keyframe, continues with further commands, and returns by method whether it continues identically."""
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


def _hour(seconds: float) -> list[Result]:
    """Restores, forks and predicts a world of a certain age just before its next keyframe."""
    command = [sys.executable, str(PROGRAMS / "hour.py"), str(seconds), str(KEYFRAME_S)]
    printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    found = json.loads(printed.rpartition("result: ")[2])
    what = f"the KUKA after {seconds:g} s at 1 kHz"
    count = len(ways := found["ways"])
    pauses = f"{what}, longest part of each of {len(found['pauses'])} keyframes, processor time"
    late = f"{what}, {KEYFRAME_S:g} s after a keyframe"
    exact = sum(is_exact for *_, is_exact in ways.values())
    results = [
        Result("keyframes", f"{pauses}: median", float(np.median(found["pauses"])), "s"),
        Result("keyframes", f"{pauses}: longest", max(found["pauses"]), "s", None, Target(MOST_PAUSE_S)),
        Result("keyframes", f"{late}: exact, of {count} methods", exact, "", None, Target(count, at_least=True)),
    ]
    for way, (wall_s, processor_s, _) in ways.items():
        results += (
            Result("keyframes", f"{late}, {way}: wall time", wall_s, "s", None, Target(MOST_S)),
            Result("keyframes", f"{late}, {way}: processor time", processor_s, "s", None, Target(MOST_S)),
        )
    return results


def _pauses(count: int) -> list[Result]:
    """Times the pauses of the demo's world for keyframes, while it is recorded."""
    with Session() as ros:
        ros.set_parameters("/ros_pybullet_interface", {"state_folder": str(ros.folder)})
        ros.node(EXAMPLE, "/rpbi/save_keyframe")
        ros.start(["rosbag", "record", "-O", str(ros.folder / "demo.bag"), *SEEN])
        found = ros.result_of(ros.program("keyframe_often", count))
    what = f"pause of the running demo for a keyframe, of {count}"
    return [
        Result("keyframes", f"{what}: median", float(np.median(found["pauses"])), "s"),
        Result("keyframes", f"{what}: longest", max(found["pauses"]), "s", None, Target(MOST_PAUSE_S)),
        Result("keyframes", "load average meanwhile", found["load"], ""),
    ]
