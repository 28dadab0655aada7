"""Reads many broken and hostile files, each in its own process, and prints a table of the results.

URDFs, meshes and YAML files are read by the program behind `./rpbi check` and by the simulator node, bags by our tools.
Run it by `./rpbi shell -c 'python3 dev/robustness/hostile_files/try_files.py'`; its table is in docs/security_tests.md.
"""

from __future__ import annotations

import argparse
import contextlib
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

from workplace import Workplace  # noqa: E402

WORKPLACE = Workplace()

from ros_system import rosgraph, stop_group, wait_until  # noqa: E402

from robustness.hostile_files.files import KINDS, Hostile, Outcome, hostile_files, outcome_of  # noqa: E402

HEAD = ("files", "number", "taken", "refused", "signals", "tracebacks", "hangs", "code", "check and node agree")


def main() -> None:
    """Reads the files; exits with 1 if a reader failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--each", type=int, default=250, help="files of each kind; default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS, metavar="KIND")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    seeds = range(arguments.first, arguments.first + arguments.each)
    rows = []
    with _master():
        for kind in arguments.kinds:
            rows.append(_row(kind, [_outcomes(each) for each in hostile_files(kind, seeds, folder)]))
    print("\n".join([_line(HEAD), "|---" * len(HEAD) + "|", *map(_line, rows)]))
    if not any(folder.iterdir()):
        folder.rmdir()
        return
    print(f"What was not fine is left in {folder}")
    sys.exit(1)


@contextlib.contextmanager
def _master() -> Iterator[None]:
    """Runs a ROS master for the nodes."""
    command = ["rosmaster", "--core", "-p", str(WORKPLACE.port.number)]
    master = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        wait_until(rosgraph.is_master_online, "the ROS master answers")
        yield
    finally:
        stop_group(master)


def _outcomes(hostile: Hostile) -> list[Outcome]:
    """Returns the results of each reader, and prints the failures."""
    outcomes = {name: outcome_of(read, hostile.canary) for name, read in hostile.readers.items()}
    if all(each.is_fine for each in outcomes.values()) and _agree(list(outcomes.values())):
        shutil.rmtree(hostile.path.parent)
    else:
        for name, (verdict, text) in outcomes.items():
            print(f"{hostile.kind} {hostile.seed}: {name}: {verdict} ({hostile.path}): {text[-1500:]}", flush=True)
    return list(outcomes.values())


def _agree(outcomes: list[Outcome]) -> bool:
    return len({each.verdict for each in outcomes}) == 1


def _row(kind: str, found: list[list[Outcome]]) -> tuple[object, ...]:
    """Returns a row of the table: the first reader's numbers of accepted and refused files, and all counts."""
    first = Counter(outcomes[0].verdict for outcomes in found)
    every = Counter(each.verdict.split()[0] for outcomes in found for each in outcomes)
    bad = every["signal"], every["traceback"] + every["silent"], every["hang"], every["code"]
    agreeing = sum(map(_agree, found)) if any(len(outcomes) > 1 for outcomes in found) else ""
    return kind, len(found), first["taken"], first["refused"], *bad, agreeing


def _line(cells: tuple[object, ...]) -> str:
    return f"| {' | '.join(map(str, cells))} |".replace("|  |", "| |")


if __name__ == "__main__":
    main()
