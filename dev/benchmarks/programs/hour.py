"""Runs a world with a target at each tick and with keyframes, and continues from a state just before the next keyframe.

It is the program of a user, without ROS. Arguments: time of the world, and period of its keyframes [s].
"""

import gc
import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from rpbi.world import World
from rpbi.world.keyframes.maker import KeyframeMaker
from rpbi.world.loading import load_world

KUKA = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
TARGET = "kuka_lwr/target"
AHEAD = 200
"""Ticks of the continuations."""
REPORTED_S = 300
"""Time of the world between two lines about it [s]."""


def main() -> None:
    seconds, every_s = map(float, sys.argv[1:])
    random = np.random.default_rng(0)
    gc.collect()
    gc.freeze()  # as the node does: a collection of all objects of this process would be the longest part
    world = World(load_world(KUKA))
    pauses = _run(world, seconds, every_s, random)
    candidate = [(tick, TARGET, _target(random)) for tick in range(AHEAD)]
    print(f"result: {json.dumps({'pauses': pauses, 'ways': _continuations(world, candidate)})}")


def _run(world: World, seconds: float, every_s: float, random: np.random.Generator) -> list[float]:
    """Runs the world until just before a keyframe; returns the processor time of the longest part of each [s]."""
    keyframes, pauses, begin_s = KeyframeMaker(world, every_s), [], time.monotonic()
    second, period = round(1.0 / world.clock.dt_s), round(every_s / world.clock.dt_s)
    longest_s = 0.0
    for tick in range(1, (round(seconds / every_s) + 1) * period):
        world.put(TARGET, _target(random))
        world.step()
        part_s = time.thread_time()
        keyframes.poll()
        longest_s = max(longest_s, time.thread_time() - part_s)
        if tick % period == period - 1:
            pauses.append(longest_s)
            longest_s = 0.0
        if tick % (REPORTED_S * second) == 0:
            print(f"{tick // second} s of the world in {time.monotonic() - begin_s:.0f} s", file=sys.stderr, flush=True)
    return pauses[1:]  # there is none in the first period


def _continuations(world: World, candidate: list[Any]) -> dict[str, tuple[float, float, bool]]:
    """Returns wall and processor time to continue from the present state [s], by method, and whether it is exact."""
    times, hashes = {}, {}

    def timed(way: str, call: Any) -> Any:
        begin_s, spent_s = time.perf_counter(), _spent_s()
        result = call()
        times[way] = time.perf_counter() - begin_s, _spent_s() - spent_s
        return result

    state = timed("save", world.save)
    fork = timed("fork, a copy", lambda: world.fork()[0])
    prediction = timed(f"predict {AHEAD} ticks", lambda: world.predict([candidate], AHEAD)[0])
    other = timed("World.from_state", lambda: World.from_state(state))
    thread = threading.Thread(target=(over := threading.Event()).wait)
    thread.start()  # with a second thread, this process cannot be copied
    second = timed("first fork, a program of its own", lambda: other.fork()[0])
    over.set()
    thread.join()
    hashes["fork, a copy"] = _go_on(fork, candidate)
    hashes["first fork, a program of its own"] = _go_on(second, candidate)
    hashes[f"predict {AHEAD} ticks"] = prediction.state_hash
    hashes["World.from_state"] = _go_on(other, candidate)
    expected = _go_on(world, candidate)
    timed("restore", lambda: world.restore(state))
    hashes["restore"] = _go_on(world, candidate)
    for each in (fork, second, other, world):
        each.close()
    return {way: (*times[way], hashes[way] == expected) for way in hashes}


def _go_on(world: Any, candidate: list[Any]) -> str:
    """Steps a world or a fork with the inputs of a candidate, one a tick; returns the hash."""
    for _, slot, value in candidate:
        world.put(slot, value)
        world.step()
    return str(world.state_hash())


def _spent_s() -> float:
    """Returns the processor time of this process and its children so far [s]."""
    children = Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split()
    return time.process_time() + sum(
        int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1e9 for pid in children
    )


def _target(random: np.random.Generator) -> dict[str, float]:
    return {"lwr_arm_0_joint": float(random.uniform(-0.5, 0.5))}


if __name__ == "__main__":
    main()
