"""The page docs/results.md: the last kept figures of each benchmark, with machine, date and commit."""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from result import Result, number

HERE = Path(__file__).resolve().parent
KEPT = HERE / "results"
"""A JSON file for each benchmark."""
ROOT = HERE.parents[1]
HEAD = """\
<!-- Written by `./rpbi bench --page` from dev/benchmarks/results: run a benchmark to change it. -->

# Results of the benchmarks

Compare these figures with those of your computer:

<!-- not run: takes minutes -->
```shell
./rpbi bench loop            # one benchmark; without a name, all that take at most a few minutes
./rpbi bench loop --page     # also onto this page
```

The column "floor" contains the same quantity for the simplest program that does the same job, measured in the same run.
A quick run measures for a shorter time. A load average above the number of cores means that other programs were busy.
Neither a quick run nor a busy computer shows how fast the simulator can be.
"""
COLUMNS = ("figure", "value", "unit", "floor", "value / floor", "target", "reached")


def keep(name: str, results: Sequence[Result], machine: Mapping[str, Any], quick: bool) -> None:
    """Keeps the figures of a benchmark, in place of former ones."""
    report = {
        "machine": machine,
        "quick": quick,
        "results": [one.as_dict() for one in results],
    }
    KEPT.mkdir(exist_ok=True)
    (KEPT / f"{name}.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def page() -> str:
    """Returns the text of docs/results.md from the kept figures."""
    return "\n".join([HEAD, *(_section(path) for path in sorted(KEPT.glob("*.json")))])


def write() -> None:
    """Writes docs/results.md."""
    (ROOT / "docs/results.md").write_text(page(), encoding="utf-8")


def _section(path: Path) -> str:
    report = json.loads(path.read_text(encoding="utf-8"))
    machine = report["machine"]
    run = f"{'Quick run' if report['quick'] else 'Run'} of {machine['date']} at commit `{machine['commit']}`"
    computer = f"{machine['cores']} cores of {machine['processor']}, load average {machine['load_average']}"
    versions = f"Python {machine['python']}, PyBullet {machine['pybullet']}, renderer {machine['renderer']}"
    rows = [COLUMNS, ("---",) * len(COLUMNS), *map(_row, report["results"])]
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"## {path.stem}\n\n{_summary(path.stem)}\n\n{run}: {computer}; {versions}.\n\n{table}\n"


def _row(one: Mapping[str, Any]) -> tuple[str, ...]:
    reached = {None: "", True: "yes", False: "no"}[one["reached"]]
    numbers = [number(one[key]) for key in ("value", "floor", "ratio")]
    return (one["figure"], numbers[0], one["unit"], *numbers[1:], one["target"] or "", reached)


def _summary(name: str) -> str:
    """Returns the first paragraph of a benchmark's docstring."""
    file = next(path for path in (HERE / f"{name}.py", HERE / name / "__init__.py") if path.exists())
    doc = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return doc.partition("\n\n")[0]
