"""The command `bench`."""

import importlib
import sys
from pathlib import Path
from typing import Annotated

from .argument import Argument, UsageError
from .modules import workspace


def bench(
    *names: Annotated[str, Argument("[NAME ...]", offers="benchmarks", files="*")],
    quick: Annotated[bool, Argument("")] = False,
    json: Annotated[Path | None, Argument("FILE", parse=Path, files="*")] = None,
    page: Annotated[bool, Argument("")] = False,
) -> int:
    """Runs benchmarks, and prints each measured figure with its lower bound, if it has one.

    Args:
        NAME: benchmark to run; by default all but browser, controls, datasets, doors, dressing, examples, farm, forks,
            guard_faults, gym, haptics, keyframes, lfd, live_plot, passivity, plan, press, pushing, recording, soak,
            streams, teleop and verify
        quick: measure for a shorter time, which is less accurate
        json: file to which the figures are written
        page: also write the figures, with machine, date and commit, to docs/results.md, which keeps the figures of
            other benchmarks
    """
    sys.path.insert(0, str(workspace() / "dev/benchmarks"))
    benchmarks = importlib.import_module("run")
    known = benchmarks.BENCHMARKS + benchmarks.WHEN_NAMED
    for name in names:
        if name not in known:
            raise UsageError(f"there is no benchmark '{name}'; there are {', '.join(known)}")
    return int(benchmarks.run(names, quick, json, page))
