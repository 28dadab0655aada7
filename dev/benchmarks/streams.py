"""Effort and lag of an iiwa: 50 targets a second with jitter and stalls, compared with targets at every tick.

The floor is the largest effort with targets at every tick. Offline cases depend on nothing but their seeds: five with
`--quick`, else fifty, on none of which the jitter buffer was tuned. Live, a node sends targets beside none, two and
seven busy processes.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import random
import sys
import tempfile
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from bench_worlds import write_main
from programs.swing import JOINT, position, velocity
from result import Result, Target
from session import Session

from rpbi.control.joint_command import JointCommand
from rpbi.world import World

DT_S = 0.002
PERIOD_S = 0.02
SECONDS = 5.0
SETTLING_S = 1.0
"""Time at the start that does not count [s]."""
FIRST_SEED = 9000
JITTER_S, STALL_S = 0.012, 0.03
LONG_STALLS_S = (0.05, 0.1, 0.18)
"""Stalls that are longer than the buffer [s]."""
MAX_LAG_MS = 50.0
STATES = "/rpbi/iiwa/joint_states"
BUSY = "while True: pass"


class Sent(NamedTuple):
    """A target.

    Attributes:
        arrival_s: When it comes [s].
        sample_s: The time whose position it is [s].
        stamp_s: Its stamp [s].
    """

    arrival_s: float
    sample_s: float
    stamp_s: float


def run(quick: bool) -> list[Result]:
    """Measures the worst of all seeds: efforts of jitter and of one short or long stall, and lags."""
    seeds = range(FIRST_SEED, FIRST_SEED + (5 if quick else 50))
    results = []
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        for velocities in (False, True):
            more = " and velocities" if velocities else ""
            every_tick = [Sent(tick * DT_S, tick * DT_S, tick * DT_S) for tick in range(round(SECONDS / DT_S))]
            floor = _follow(Path(folder), every_tick, velocities)[0]
            for stamps in ("sample", "sending", "none"):
                jitter = [_follow(Path(folder), _late(seed, stamps, JITTER_S), velocities) for seed in seeds]
                stall = [_follow(Path(folder), _late(seed, stamps, 0.0, STALL_S), velocities) for seed in seeds]
                long_stall = [
                    _follow(Path(folder), _late(seed, stamps, 0.0, stall_s), velocities)
                    for seed, stall_s in zip(seeds, itertools.cycle(LONG_STALLS_S))
                ]
                name = f"stamps of the {stamps}{more}" if stamps != "none" else f"no stamps{more}"
                effort, lag_ms = (max(each) for each in zip(*jitter))
                target = Target(1.5, of_floor=True)
                results += [
                    Result("streams", f"jitter, {name}", effort, "N m", floor, Target(1.2, of_floor=True)),
                    Result("streams", f"one stall, {name}", max(stall)[0], "N m", floor, target),
                    Result("streams", f"one long stall, {name}", max(long_stall)[0], "N m", floor, target),
                    Result("streams", f"lag, {name}", lag_ms, "ms", None, Target(MAX_LAG_MS)),
                ]
        floor = results[0].floor
    for busy, *options in ((0,), (2,), (7,), (7, "--no-stamps")):
        name = f"live beside {busy} busy processes{', no stamps' if options else ''}"
        effort = _live(10.0 if quick else 30.0, busy, *options)
        results.append(Result("streams", name, effort, "N m", floor, Target(1.5, of_floor=True)))
    return results


def _world(folder: Path) -> dict[str, Any]:
    """Returns the main configuration of the arm, whose file is written into a folder."""
    arm = {
        "name": "iiwa",
        "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "joint_state_publisher_hz": round(1.0 / DT_S),
    }
    (folder / "iiwa.yaml").write_text(yaml.safe_dump(arm))
    connect = {"connection_mode": "DIRECT"}
    robots = [str(folder / "iiwa.yaml")]
    return {"connect": connect, "setGravity": {"gravZ": -9.81}, "timeStep": DT_S, "robots": robots}


def _late(seed: int, stamps: str, jitter_s: float, stall_s: float = 0.0) -> list[Sent]:
    """Returns targets that are late by up to a time, one of them because of a stall; their order is kept."""
    rng = random.Random(seed)
    count = round(SECONDS / PERIOD_S)
    stalled = rng.randrange(round(SETTLING_S / PERIOD_S), count - 10) if stall_s else None
    sent, arrival_s = [], 0.0
    for number in range(count):
        sample_s = number * PERIOD_S
        late_s = stall_s if number == stalled else rng.uniform(0.0, jitter_s)
        arrival_s = max(arrival_s, sample_s + late_s)
        sent.append(Sent(arrival_s, sample_s, {"sample": sample_s, "sending": arrival_s, "none": -1.0}[stamps]))
    return sent


def _follow(folder: Path, sent: Sequence[Sent], velocities: bool) -> tuple[float, float]:
    """Returns the largest effort [N m] and the mean lag [ms] of a robot that follows targets."""
    waiting, states = deque(sent), []
    with contextlib.closing(World.from_file(str(write_main(folder, _world(folder))))) as world:
        arm: Any = world.bodies["iiwa"]
        for tick in range(round(SECONDS / DT_S)):
            while waiting and waiting[0].arrival_s <= tick * DT_S + 1e-9:
                one = waiting.popleft()
                given = [velocity(one.sample_s)] if velocities else []
                stamp_ns = round(1e9 * (1.0 + one.stamp_s))
                world.put("iiwa/target", JointCommand([JOINT], [position(one.sample_s)], given, stamp_ns=stamp_ns))
            world.step()
            found, _, _, effort = arm.pb.getJointState(arm.body_id, arm.model[JOINT].index)
            time_s = (tick + 1) * DT_S
            states.append((found - position(time_s), velocity(time_s), effort))
    error, speed, effort = np.array(states)[round(SETTLING_S / DT_S) :].T
    return float(np.abs(effort).max()), float(-1e3 * (error @ speed) / (speed @ speed))


def _live(seconds: float, busy: int, *options: str) -> float:
    """Returns the largest effort [N m] of a robot that a node swings with options, while some processes are busy."""
    with Session(use_sim_time=False) as ros:
        ros.simulator(_world(ros.folder))
        for _ in range(busy):
            ros.start([sys.executable, "-c", BUSY])
        efforts = ros.result_of(ros.program("swing", STATES, seconds, *options))
    largest = max(map(abs, efforts))
    if not math.isfinite(largest):
        raise RuntimeError(f"efforts must be finite, got {largest}")
    return float(largest)
