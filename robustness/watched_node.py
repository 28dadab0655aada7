"""The simulator node, with a file of its pauses: `watched_node.py FILE ARGUMENTS ...`.

Each line has, as JSON: the time at which a tick began [s, monotonic], how long after the one before [s], how much of
that its thread waited for a processor, and how much it spent on adding and removing objects, most of it in PyBullet.
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

from rpbi.engine import contents
from rpbi.ros import node
from rpbi.world import World

SHORTEST_S = 0.005
"""Pauses that are shorter are not written."""
PRIORITY = -15
"""Beside other work; whoever may not have it runs without."""


def main() -> None:
    """Runs the node."""
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)
    file = open(sys.argv.pop(1), "a", buffering=1)
    spent = [0.0]
    contents.apply = _timed(contents.apply, spent)
    step, last = World.step, [time.monotonic(), 0.0, 0.0]

    def watched(world: World) -> Any:
        now, waited = time.monotonic(), _waited_s()
        if now - last[0] > SHORTEST_S:
            file.write(json.dumps([now, now - last[0], waited - last[1], spent[0] - last[2]]) + "\n")
        last[:] = now, waited, spent[0]
        return step(world)

    World.step = watched  # type: ignore[method-assign, assignment]
    node.main()


def _timed(call: Callable[..., Any], spent: list[float]) -> Callable[..., Any]:
    @functools.wraps(call)
    def timed(*arguments: Any, **more: Any) -> Any:
        began_s = time.monotonic()
        try:
            return call(*arguments, **more)
        finally:
            spent[0] += time.monotonic() - began_s

    return timed


def _waited_s() -> float:
    return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) * 1e-9


if __name__ == "__main__":
    main()
