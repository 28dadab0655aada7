"""Tables of the results, as text and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from custom_ros_tools.files import atomic_file

from .evaluation import PushResult, Row, TossResult, as_numbers

TOSS_COLUMNS = {
    "position": "position, % of the width",
    "rotation": "rotation, deg",
    "final_position": "position at the end, %",
    "final_rotation": "rotation at the end, deg",
}
PUSH_COLUMNS = {
    "hand_mm": "hand, mm",
    "hand_deg": "hand, deg",
    "cube_mm": "cube, mm",
    "cube_deg": "cube, deg",
    "cube_final_mm": "cube at the end, mm",
}


def table(title: str, columns: dict[str, str], rows: Iterable[Row]) -> str:
    """Returns a table in Markdown.

    Args:
        title: Heading of the first column.
        columns: Heading of each column, indexed by the name of its cells.
        rows: The rows.
    """
    lines = [f"| {title} | {' | '.join(columns.values())} |", "|---" * (len(columns) + 1) + "|"]
    lines += [f"| {row.name} | {' | '.join(str(row.cells.get(key, '-')) for key in columns)} |" for row in rows]
    return "\n".join(lines)


def toss_table(result: TossResult) -> str:
    """Returns the table of the tosses in Markdown."""
    return table(f"{len(result.data.tosses)} tosses", TOSS_COLUMNS, result.rows)


def push_table(result: PushResult) -> str:
    """Returns the table of an experiment of the arm in Markdown."""
    return table(f"experiment {result.experiment}, {len(result.runs)} runs", PUSH_COLUMNS, result.rows)


def write_json(path: Path, tosses: TossResult | None, pushes: Iterable[PushResult], problems: list[str]) -> None:
    """Writes the numbers of all tables.

    Args:
        path: The file.
        tosses: Results of the tosses; None without tosses.
        pushes: Results of the arm's experiments.
        problems: Parts that could not be evaluated.
    """
    content: dict[str, Any] = {"problems": problems}
    if tosses is not None:
        rows = {row.name: as_numbers(row) for row in tosses.rows}
        content["tosses"] = {"tosses": len(tosses.data.tosses), "rows": rows}
    content["pushes"] = {
        str(each.experiment): {"runs": len(each.runs), "rows": {row.name: as_numbers(row) for row in each.rows}}
        for each in pushes
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path) as part:
        part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
