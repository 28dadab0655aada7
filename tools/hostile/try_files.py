"""Reads many broken and hostile files, each in a process of its own, and prints a table of what became of that.

Run it by `./rpbi shell -c 'python3 tools/hostile/try_files.py'`; the table in docs/security.md is its.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))

from hostile_files import KINDS, hostile_files, outcome_of  # noqa: E402


def main() -> None:
    """Reads the files; exits with 1 if one of them did what none may do."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--each", type=int, default=250, help="files of each kind; default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS, metavar="KIND")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in arguments.kinds}
    bad = 0
    for kind in arguments.kinds:
        for hostile in hostile_files(kind, range(arguments.first, arguments.first + arguments.each), folder):
            outcome = outcome_of(hostile.read, hostile.path.parent / "canary")
            counts[kind][outcome.verdict] += 1
            if outcome.is_fine:
                shutil.rmtree(hostile.path.parent)
            else:
                bad += 1
                print(f"{kind} {hostile.seed}: {outcome.verdict} ({hostile.path}): {outcome.text[-1500:]}", flush=True)
    print(
        "| files | number | taken | refused | signals | tracebacks | hangs | code |\n|---|---|---|---|---|---|---|---|"
    )
    for kind, found in counts.items():
        signals = sum(number for verdict, number in found.items() if verdict.startswith("signal"))
        rest = [found["traceback"] + found["silent"], found["hang"], found["code"]]
        row = [found.total(), found["taken"], found["refused"], signals, *rest]
        print(f"| {kind} | {' | '.join(map(str, row))} |")
    if not bad:
        shutil.rmtree(folder)
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
