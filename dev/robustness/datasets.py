"""Checks hostile data sets with `check_dataset`, and prints a table of the outcomes.

Run by `./rpbi shell -c 'nice -n 19 python3 dev/robustness/datasets.py'`, it checks 500 of each format, each in a
process of its own; the table in docs/security_tests.md is its.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

import av  # noqa: E402, F401 (imported once, before the forks)
import h5py  # noqa: E402, F401
import pyarrow.parquet  # noqa: E402, F401
import rosbags.rosbag2  # noqa: E402, F401

from custom_ros_tools.console.modules import command_of  # noqa: E402
from robustness.hostile_bags.trial import Trial, tried  # noqa: E402
from robustness.hostile_datasets.makers import MAKERS, good_datasets, hostile_datasets  # noqa: E402
from rpbi_data.datasets.formats import lerobot, mcap, robomimic  # noqa: E402, F401

MAX_MEMORY_MB = 2000.0
MODULE = "canary_module"
"""Module that data sets name; it is on the path, and makes the canary when it is imported."""


def main() -> None:
    """Checks the data sets; exits with 1 if a check failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=500, help="of each format; default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    parser.add_argument("--formats", nargs="+", default=list(MAKERS), choices=MAKERS, help="default: all")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    good = good_datasets(folder)
    seeds = range(arguments.first, arguments.first + arguments.count)
    modules = folder / "modules"
    modules.mkdir()
    (modules / f"{MODULE}.py").write_text("import pathlib\npathlib.Path('canary').touch()\nclass Canary: pass\n")
    sys.path.append(str(modules))
    print(
        "| format | data sets | no fault | faults | signals | tracebacks | code | written | longest [s] | memory [MB] |"
    )
    print("|---" * 10 + "|", flush=True)
    is_fine = True
    for name in arguments.formats:
        trials = []
        for hostile in hostile_datasets(name, good[name], seeds, folder):
            before = _content(folder)
            trial = tried(_check, hostile.path)
            if trial.verdict in ("taken", "refused") and _content(folder) != before:
                trial = trial._replace(verdict="written")
            trials.append(trial)
            if not _is_fine(trial):
                is_fine = False
                print(f"{name} {hostile.seed} ({hostile.how}): {trial}", flush=True)
            else:
                shutil.rmtree(hostile.path.parent)
        print(_row(name, trials), flush=True)
    print("load:", *(f"{load:.1f}" for load in os.getloadavg()))
    if is_fine:
        shutil.rmtree(folder)
    sys.exit(not is_fine)


def _check(path: Path) -> None:
    command = command_of("rpbi_data.console.check_dataset")
    assert command is not None
    sys.exit(command.run([str(path)]))


def _is_fine(trial: Trial) -> bool:
    return trial.is_fine and trial.memory_mb <= MAX_MEMORY_MB and "\x1b" not in trial.said


def _content(folder: Path) -> str:
    """Returns a digest of the names, sizes and times of all files in a folder."""
    digest = hashlib.sha256()
    for place, folders, files in sorted(os.walk(folder)):
        for name in sorted((*folders, *files)):
            status = os.lstat(os.path.join(place, name))
            digest.update(os.fsencode(f"{place}/{name} {status.st_size} {status.st_mtime_ns}\n"))
    return digest.hexdigest()


def _row(name: str, trials: list[Trial]) -> str:
    of = Counter(trial.verdict.split()[0] for trial in trials)
    slowest, largest = max(trial.cpu_s for trial in trials), max(trial.memory_mb for trial in trials)
    bad = of["signal"], of["traceback"] + of["silent"], of["code"], of["written"]
    cells = name, len(trials), of["taken"], of["refused"], *bad, f"{slowest:.1f}", f"{largest:.0f}"
    return f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    main()
