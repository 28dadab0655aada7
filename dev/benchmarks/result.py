"""Figures of a benchmark, and their table."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any


@dataclasses.dataclass(frozen=True)
class Target:
    """Target of a figure.

    Attributes:
        limit: The limit, in the figure's unit or in multiples of its floor.
        at_least: Whether more is better.
        of_floor: Whether the limit is a multiple of the floor.
    """

    limit: float
    at_least: bool = False
    of_floor: bool = False

    def __str__(self) -> str:
        return f"{'>=' if self.at_least else '<='} {self.limit:g}{' x floor' if self.of_floor else ''}"


@dataclasses.dataclass(frozen=True)
class Result:
    """One measured figure.

    Attributes:
        benchmark: Name of the benchmark.
        figure: What was measured.
        value: Its value.
        unit: Unit of value and floor.
        floor: The lower bound: the same quantity for the simplest program that does the job, measured in the same run;
            None if there is none.
        target: What to reach; None if the figure only informs.
    """

    benchmark: str
    figure: str
    value: float
    unit: str
    floor: float | None = None
    target: Target | None = None

    @property
    def ratio(self) -> float | None:
        """Value over floor."""
        return self.value / self.floor if self.floor else None

    @property
    def reached(self) -> bool | None:
        """Whether the target is reached, None without one."""
        if self.target is None:
            return None
        value = self.ratio if self.target.of_floor else self.value
        if value is None:
            return False
        return bool(value >= self.target.limit if self.target.at_least else value <= self.target.limit)

    def as_dict(self) -> dict[str, Any]:
        """Returns all of it for JSON."""
        target = None if self.target is None else str(self.target)
        return {**dataclasses.asdict(self), "ratio": self.ratio, "target": target, "reached": self.reached}


def table(results: Sequence[Result]) -> str:
    """Returns results as a text table."""
    rows = [("benchmark", "figure", "value", "unit", "floor", "ratio", "target", "reached")]
    for one in results:
        reached = {None: "", True: "yes", False: "NO"}[one.reached]
        numbers = [number(each) for each in (one.value, one.floor, one.ratio)]
        target = str(one.target or "")
        rows.append((one.benchmark, one.figure, numbers[0], one.unit, *numbers[1:], target, reached))
    widths = [max(map(len, column)) for column in zip(*rows)]
    right = (2, 4, 5)
    lines = [
        "  ".join(
            cell.rjust(width) if index in right else cell.ljust(width)
            for index, (cell, width) in enumerate(zip(row, widths))
        ).rstrip()
        for row in rows
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])


def number(value: float | None) -> str:
    """Returns a number with four digits, or an empty text for None."""
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value) >= 10_000 else f"{value:.4g}"
