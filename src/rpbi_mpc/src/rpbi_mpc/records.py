"""Writes the cycles of a loop as a table, and computes a summary of the table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .controller import MpcController
from .loop import Cycle, Status

if TYPE_CHECKING:
    import pandas


def table_of(cycles: Sequence[Cycle], controller: MpcController) -> pandas.DataFrame:
    """Returns a table with one row for each cycle.

    The first columns are `cycle`, `time_s`, `status`, `reason`, `cost`, `iterations`, `wall_s` and `processor_s`. The
    `extras` of the plans follow. The last columns are the measurement, the command and the first predicted state, with
    the prefixes `measured.`, `command.` and `state.`.
    """
    import pandas

    return pandas.DataFrame([_row(cycle, controller) for cycle in cycles])


def summary_of(table: pandas.DataFrame) -> dict[str, Any]:
    """Returns a summary of the table: the number of cycles for each status, and mean, 99 % quantile and maximum of the
    solve times [ms].
    """
    solved = table[table["wall_s"].notna()] if len(table) else table
    times = {
        f"{name}_{figure}_ms": float(function(1e3 * solved[f"{name}_s"]))
        for name in ("wall", "processor")
        for figure, function in (("mean", np.mean), ("p99", lambda values: np.quantile(values, 0.99)), ("max", np.max))
        if len(solved)
    }
    counts = {str(status): int((table["status"] == str(status)).sum()) if len(table) else 0 for status in Status}
    return {"cycles": len(table), "by_status": counts, **times}


def write_records(folder: str | Path, cycles: Sequence[Cycle], controller: MpcController) -> dict[str, Any]:
    """Writes `cycles.csv` and `summary.json` to a folder, and returns the summary. Creates the folder if necessary.

    Raises:
        OSError: If the folder cannot be written.
    """
    path = Path(folder).expanduser()
    path.mkdir(parents=True, exist_ok=True)
    table = table_of(cycles, controller)
    table.to_csv(path / "cycles.csv", index=False)
    summary = summary_of(table)
    (path / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    return summary


def _row(cycle: Cycle, controller: MpcController) -> dict[str, Any]:
    plan, sensed = cycle.plan, cycle.sensed
    row: dict[str, Any] = {
        "cycle": cycle.index,
        "time_s": sensed.time_s,
        "status": str(cycle.status),
        "reason": cycle.reason,
        "cost": None if plan is None else plan.cost,
        "iterations": None if plan is None else plan.iterations,
        "wall_s": None if plan is None else plan.wall_s,
        "processor_s": None if plan is None else plan.processor_s,
        **({} if plan is None else plan.extras),
    }
    first = None if plan is None or not len(plan.states) else plan.states[0]
    for prefix, names, numbers in (
        ("measured", controller.measured_names, sensed.values),
        ("command", controller.command_names, cycle.command),
        ("state", controller.state_names, first),
    ):
        row |= {f"{prefix}.{name}": None if numbers is None else float(numbers[i]) for i, name in enumerate(names)}
    return row
