"""The command `identify`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument, UsageError
from rpbi_reality.identification.identify import identify_world, read_fit, summary, write_results


def identify(
    world: Annotated[str, Argument("WORLD", files="*.yaml")],
    data: Annotated[Path, Argument("DATA", parse=Path, files="*")],
    *,
    fit: Annotated[Path, Argument("FILE", parse=Path, files="*.yaml")] = Path("fit.yaml"),
    out: Annotated[Path, Argument("FOLDER", parse=Path, files="*")] = Path("out/identify"),
    urdf: Annotated[Path | None, Argument("FILE", parse=Path, files="*.urdf")] = None,
    jobs: Annotated[int | None, Argument("N", parse=int)] = None,
) -> int:
    """Identifies parameters of a world, such as friction, masses, gains and delays, from measured motion.

        ./rpbi identify world.yaml run.bag --fit fit.yaml

    Writes the world with the identified values, a report with intervals, a picture, and a file with the intervals as
    random variation for environments. The same seed leads to the same files. See docs/identification.md.

    Usage:
        ./rpbi identify WORLD DATA [--fit FILE] [--out FOLDER] [--urdf FILE] [--jobs N]

    Args:
        world: main YAML file of the world
        data: measured motion: a bag, an NPZ file or a CSV file
        fit: YAML file with parameters, bounds and signals; default fit.yaml
        out: folder for the results; default out/identify
        urdf: URDF to load where the world names robot_description
        jobs: number of processes; default: number of processors
    """
    if jobs is not None and jobs < 1:
        raise UsageError(f"--jobs: expected at least 1, got {jobs}")
    shows = sys.stderr.isatty()

    def report(line: str) -> None:
        if shows:
            print(f"\r{line}\033[K", end="", file=sys.stderr, flush=True)

    config = read_fit(fit)
    result = identify_world(world, data, config, jobs or os.cpu_count() or 1, str(urdf) if urdf else None, report)
    if shows:
        print("\r\033[K", end="", file=sys.stderr)
    print(summary(result))
    for path in write_results(out, world, config, result):
        print(path)
    return 0
