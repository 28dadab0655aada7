"""Reads hostile files with every reader of this workspace, and prints a table of the results.

Run it by `./rpbi shell -c 'python3 dev/robustness/try_files.py'`; exits with 1 if a reader did what none may do.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

from workplace import Workplace  # noqa: E402

WORKPLACE = Workplace()

from robustness.trials import Outcome, outcomes  # noqa: E402

COUNTS = {"urdf": 2000, "mesh": 500, "yaml": 1000}
HEAD = (
    "files",
    "number",
    "readers",
    "taken",
    "refused",
    "signals",
    "tracebacks",
    "silent",
    "hangs",
    "code",
    "longest [s]",
)


def main() -> None:
    """Reads the files."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--share", type=float, default=1.0, help="share of 2000 URDFs, 500 meshes and 1000 YAML files")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    parser.add_argument("--kinds", nargs="+", choices=COUNTS, default=[*COUNTS], metavar="KIND")
    parser.add_argument("--node", action="store_true", help="have a running simulator add them instead")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="robustness-"))
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")  # no mesh was tried before
    rows = []
    for kind in arguments.kinds:
        seeds = range(arguments.first, arguments.first + round(COUNTS[kind] * arguments.share))
        if arguments.node:
            from robustness.running_node import outcomes_in_node

            found = list(shown(kind, outcomes_in_node(WORKPLACE, kind, seeds, folder)))
        else:
            found = list(shown(kind, outcomes(kind, seeds, folder)))
        rows.append(_row(kind, len(seeds), found))
        print("\n".join([_line(HEAD), "|---" * len(HEAD) + "|", *map(_line, rows)]), flush=True)
    largest_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    print(f"largest process: {largest_mb:.0f} MB; load:", *(f"{load:.1f}" for load in os.getloadavg()))
    shutil.rmtree(folder / "cache", ignore_errors=True)
    if not any(folder.iterdir()):
        folder.rmdir()
        return
    print(f"What was not fine is left in {folder}")
    sys.exit(1)


def shown(kind: str, found: Iterable[Outcome]) -> Iterable[Outcome]:
    """Yields outcomes, and prints those that are not fine."""
    for outcome in found:
        if not outcome.is_fine:
            print(f"{kind} {outcome.seed}: {outcome.reader}: {outcome.verdict}: {outcome.text[-1500:]}", flush=True)
        yield outcome


def _row(kind: str, number: int, found: list[Outcome]) -> tuple[object, ...]:
    """Returns a row of the table; accepted and refused files are those of `world` or `node`, others of all readers."""
    first = Counter(outcome.verdict for outcome in found if outcome.reader in ("world", "node"))
    every = Counter(outcome.verdict.split()[0] for outcome in found)
    bad = (every[each] for each in ("signal", "traceback", "silent", "hang", "code"))
    longest = max((outcome.seconds for outcome in found), default=0.0)
    readers = len({outcome.reader for outcome in found})
    return kind, number, readers, first["taken"], first["refused"], *bad, f"{longest:.1f}"


def _line(cells: tuple[object, ...]) -> str:
    return f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    main()
