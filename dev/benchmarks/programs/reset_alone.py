"""Times to load a world, for a tick and for the hash of its state, without ROS."""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable

from rpbi.world import World


def main() -> None:
    """Prints the times as JSON."""
    parser = argparse.ArgumentParser()
    parser.add_argument("world", help="main YAML file")
    path = parser.parse_args().world
    World.from_file(path).close()  # files that are read for the first time come from the disk
    loads = [_time(lambda: World.from_file(path).close()) for _ in range(10)]
    world = World.from_file(path)
    ticks = [_time(world.step) for _ in range(2000)]
    hashes = [_time(world.state_hash) for _ in range(2000)]
    found = {"load_ms": 1e3 * statistics.median(loads)}
    found |= {"tick_us": 1e6 * statistics.median(ticks), "hash_us": 1e6 * statistics.median(hashes)}
    print("result:", json.dumps(found))


def _time(job: Callable[[], object]) -> float:
    start_s = time.perf_counter()
    job()
    return time.perf_counter() - start_s


if __name__ == "__main__":
    main()
