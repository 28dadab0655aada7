"""Reads hostile folders with each reader of episodes, and prints a table of the results.

Run by `./rpbi shell -c 'python3 dev/robustness/episode_folders.py'`, it reads 1,000 of them with each reader, each in a
process of its own; the table in docs/security_tests.md is its.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import importlib
import os
import shutil
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]


import rpbi_data.view.bag_messages  # noqa: E402
import rpbi_data.view.page  # noqa: E402, F401
from custom_ros_tools.console.modules import command_of  # noqa: E402
from robustness.hostile_bags.trial import Trial  # noqa: E402
from robustness.hostile_episodes.good import write_good  # noqa: E402
from robustness.hostile_episodes.makers import hostile_folders  # noqa: E402
from robustness.hostile_episodes.trial import READERS, is_fine, trials  # noqa: E402
from rpbi_data.datasets.formats import FORMATS  # noqa: E402


def main() -> None:
    """Reads the folders; exits with 1 if a reader failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    parser.add_argument("--readers", nargs="+", default=list(READERS), help="default: all")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    write_good(folder / "good/source", folder / "good/demos")
    for name in ("lerobot", "robomimic", "mcap"):  # imported once for all forks
        FORMATS.configured(name, "")
    for name in ("episodes", "view", "export"):
        command_of(f"rpbi_data.console.{name}")
    importlib.import_module("pyarrow.parquet")
    gc.freeze()  # otherwise garbage collection in each fork copies the visited memory
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell has its background jobs ignore
    readers = {name: READERS[name] for name in arguments.readers}
    table: dict[str, list[Trial]] = {name: [] for name in readers}
    with contextlib.suppress(KeyboardInterrupt):  # which prints the table so far
        for hostile in hostile_folders(
            range(arguments.first, arguments.first + arguments.count), folder / "good", folder
        ):
            print(f"\r{hostile.seed} {hostile.how:40}", end="", file=sys.stderr, flush=True)
            all_fine = True
            for name, trial in trials(hostile, readers):
                table[name].append(trial)
                if not is_fine(trial):
                    all_fine = False
                    print(f"{hostile.seed} ({hostile.how}): {name}: {trial}", flush=True)
            if all_fine:
                shutil.rmtree(hostile.outside.parent)
    bad = ("outside", "code", "signal", "traceback", "silent")
    columns = ("reader", "folders", "taken", "refused", *bad[:3], "tracebacks", "longest [s]", "most memory [MB]")
    print(f"| {' | '.join(columns)} |")
    print("|---" * len(columns) + "|")
    for name, of_reader in table.items():
        of = Counter(trial.verdict.split()[0] for trial in of_reader)
        slowest, largest = max(each.cpu_s for each in of_reader), max(each.memory_mb for each in of_reader)
        counts = [of[each] for each in ("taken", "refused", *bad[:3])]
        cells = name, len(of_reader), *counts, of["traceback"] + of["silent"], f"{slowest:.1f}", f"{largest:.0f}"
        print(f"| {' | '.join(map(str, cells))} |")
    fine = all(is_fine(each) for of_reader in table.values() for each in of_reader)
    print("load:", *(f"{load:.1f}" for load in os.getloadavg()))
    if fine:
        shutil.rmtree(folder)
    sys.exit(not fine)


if __name__ == "__main__":
    main()
