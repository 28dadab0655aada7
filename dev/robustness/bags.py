"""Reads hostile bags with each reader of bags, and prints a table of the results.

Run by `./rpbi shell -c 'python3 dev/robustness/bags.py'`, it reads 1,000 of them with each reader and with replay, each
in a process of its own; the table in docs/security_tests.md is its.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

from robustness.hostile_bags.makers import hostile_bags  # noqa: E402
from robustness.hostile_bags.trial import READERS, Trial, tried  # noqa: E402


def main() -> None:
    """Reads the bags; exits with 1 if a reader failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    table: dict[str, list[Trial]] = {name: [] for name in READERS}
    with contextlib.suppress(KeyboardInterrupt):  # which prints the table so far
        for hostile in hostile_bags(range(arguments.first, arguments.first + arguments.count), folder):
            trials = {name: tried(read, hostile.path) for name, read in READERS.items()}
            print(f"\r{hostile.seed} {hostile.how:40}", end="", file=sys.stderr, flush=True)
            for name, trial in trials.items():
                table[name].append(trial)
                if not trial.is_fine:
                    print(f"{hostile.seed} ({hostile.how}): {name}: {trial}", flush=True)
            if all(trial.is_fine for trial in trials.values()):
                shutil.rmtree(hostile.path.parent)
    print("| reader | bags | taken | refused | signals | tracebacks | code | longest [s] | most memory [MB] |")
    print("|---" * 9 + "|")
    for name, trials in table.items():
        of = Counter(trial.verdict.split()[0] for trial in trials)
        slowest, largest = max(trial.cpu_s for trial in trials), max(trial.memory_mb for trial in trials)
        bad = of["signal"], of["traceback"] + of["silent"], of["code"]
        cells = name, len(trials), of["taken"], of["refused"], *bad, f"{slowest:.1f}", f"{largest:.0f}"
        print(f"| {' | '.join(map(str, cells))} |")
    fine = all(trial.is_fine for trials in table.values() for trial in trials)
    print("load:", *(f"{load:.1f}" for load in os.getloadavg()))
    if fine:
        shutil.rmtree(folder)
    sys.exit(not fine)


if __name__ == "__main__":
    main()
