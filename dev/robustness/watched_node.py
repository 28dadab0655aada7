"""The simulator node, with a file of its pauses: `watched_node.py FILE ARGUMENTS ...`.

Each line has, as JSON, in seconds: the time at which a tick began, how long after the one before, for how much of that
its thread waited for a processor, the processor time of the whole process, and that inside PyBullet's functions that
load and step.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pybullet

SHORTEST_S = 0.005
"""Shorter pauses are not written."""
PRIORITY = -15
"""Priority over other work; without permission, it runs without it."""
INDIVISIBLE = (
    *("loadURDF", "loadSoftBody", "createVisualShape", "createCollisionShape", "createMultiBody", "removeBody"),
    "stepSimulation",
)
"""PyBullet's functions that add and remove objects, and its step: PyBullet determines the duration of each call."""
inside_s = 0.0
"""Processor time that they have taken."""


def main() -> None:
    """Runs the node."""
    for name in INDIVISIBLE:
        setattr(pybullet, name, _timed(getattr(pybullet, name)))

    from rpbi.ros import node  # after that, so that it gets the timed functions
    from rpbi.world import World

    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)
    file = open(sys.argv.pop(1), "a", buffering=1)
    step, last = World.step, _clocks()

    def watched(world: World) -> Any:
        nonlocal last
        now = _clocks()
        if now[0] - last[0] > SHORTEST_S:
            file.write(json.dumps([now[0], *(after - before for after, before in zip(now, last, strict=True))]) + "\n")
        last = now
        return step(world)

    World.step = watched  # type: ignore[method-assign, assignment]
    node.main()


def _clocks() -> tuple[float, float, float, float]:
    waited_s = int(Path("/proc/thread-self/schedstat").read_text().split()[1]) * 1e-9
    return time.monotonic(), waited_s, time.process_time(), inside_s


def _timed(call: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(call)
    def timed(*arguments: Any, **more: Any) -> Any:
        global inside_s
        began_s = time.thread_time()
        try:
            return call(*arguments, **more)
        finally:
            inside_s += time.thread_time() - began_s

    return timed


if __name__ == "__main__":
    main()
