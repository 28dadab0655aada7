"""Draws figures from the tables of a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .row_plan import RECORD_TIME
from .tables import file_stems
from .transforms import TRANSLATION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_LINES = 20
"""Largest number of lines of a panel that has a legend; panels with more lines have no legend."""
MAX_POINTS = 20_000
"""Largest number of drawn points of a line; if a line has more points, only every k-th point is drawn."""
_AXES = "xyz"
_QUANTITIES = {
    "position": "position [rad or m]",
    "velocity": "velocity [rad/s or m/s]",
    "effort": "effort [N m or N]",
}


def plot_tables(tables: Mapping[str, pd.DataFrame], new_figure: Callable[..., Figure]) -> Iterator[tuple[str, Figure]]:
    """Yields figures of a bag's tables, each with a file name without suffix.

    Each figure has a panel for each quantity:

    - joint states: positions, velocities and efforts,
    - wrenches: forces and torques,
    - transforms: x, y and z of all frames of a body,
    - contacts: normal forces, with a line for each touching body.

    The last figures show the times between messages, and the delays from stamp to recording, for all topics.

    Args:
        tables: Tables from `bag_to_dataframes`, indexed by topic. The time axis starts at the first row of all tables.
        new_figure: `matplotlib.figure.Figure`, or `matplotlib.pyplot.figure` for windows.
    """
    filled = {topic: table for topic, table in tables.items() if len(table)}
    start_s = min((table.index[0] for table in filled.values()), default=0.0)
    relative = {topic: table.set_index(table.index - start_s) for topic, table in filled.items()}
    stems = file_stems(relative)
    for topic, table in relative.items():
        for suffix, panels in panels_of(table):
            yield f"{stems[topic]}{suffix}", _figure(new_figure, topic, panels)
    if relative:
        yield "rates", _figure(new_figure, "time between messages", {"time [ms]": _intervals(relative)}, scale="log")
    delays = _delays(filled, start_s)
    if delays:
        yield "latencies", _figure(new_figure, "time of recording less stamp", {"delay [ms]": delays})


Lines = Mapping[str, pd.Series]
"""Values over time [s], indexed by the name of the line."""


def panels_of(table: pd.DataFrame) -> Iterator[tuple[str, Mapping[str, Lines]]]:
    """Yields, for each figure of a table, a suffix for the file name, and the panels, indexed by y-axis label."""
    if {"link", "other_body", "normal_force"} <= set(table.columns):
        forces = table.groupby([table.index, "other_body"])["normal_force"].sum().unstack(fill_value=0.0)
        every = forces.reindex(table.index.unique(), fill_value=0.0)
        yield "", {"normal force [N]": {f"by {body}": every[body] for body in every}}
        return
    joints = {label: _by_last_name(table.filter(regex=f"^{field}/")) for field, label in _QUANTITIES.items()}
    if any(joints.values()):
        yield "", {label: lines for label, lines in joints.items() if lines}
    force = _vector(table, ("wrench/force", "force"))
    torque = _vector(table, ("wrench/torque", "torque"))
    if force and torque:
        yield "", {"force [N]": force, "torque [N m]": torque}
    if {"child", "parent", *TRANSLATION} <= set(table.columns):
        bodies: dict[tuple[str, str], dict[str, Lines]] = {}
        for (parent, child), rows in table.groupby(["parent", "child"], sort=True):
            if len(rows) > 1 and (np.ptp(rows[TRANSLATION].to_numpy(), axis=0) > 0).any():
                bodies.setdefault((parent, child.rpartition("/")[0] or child), {})[child] = _vector(
                    rows, ("translation",)
                )
        stems = file_stems(f"{body} in {parent}" if _is_twice(body, bodies) else body for parent, body in bodies)
        for stem, ((parent, body), paths) in zip(stems.values(), bodies.items(), strict=True):
            names = {child: child.removeprefix(f"{body}/") for child in paths}
            panels = {
                f"{axis} in {parent} [m]": {names[child]: path[axis] for child, path in paths.items()} for axis in _AXES
            }
            yield f".{stem}", panels


def _is_twice(body: str, bodies: Iterable[tuple[str, str]]) -> bool:
    """Returns whether a body occurs with more than one parent frame."""
    return sum(other == body for _, other in bodies) > 1


def _by_last_name(table: pd.DataFrame) -> Lines:
    """Returns the columns with nonzero values, indexed by joint name. Columns of fixed joints are thus left out."""
    return {name.partition("/")[2]: table[name] for name in table if table[name].fillna(0.0).any()}


def _vector(table: pd.DataFrame, prefixes: Sequence[str]) -> Lines:
    """Returns columns `PREFIX/x` to `PREFIX/z` for the first prefix that the table has; empty if it has none."""
    for prefix in prefixes:
        if {f"{prefix}/{axis}" for axis in _AXES} <= set(table.columns):
            return {axis: table[f"{prefix}/{axis}"] for axis in _AXES}
    return {}


def _intervals(tables: Mapping[str, pd.DataFrame]) -> Lines:
    times = {topic: table.index.unique().to_numpy() for topic, table in tables.items()}
    return {topic: pd.Series(1e3 * np.diff(each), each[1:]) for topic, each in times.items() if len(each) > 1}


def _delays(tables: Mapping[str, pd.DataFrame], start_s: float) -> Lines:
    """Returns the delay from stamp to recording of each topic [ms]; topics without stamps are left out."""
    delays = {topic: 1e3 * (table[RECORD_TIME] - table.index.to_numpy()) for topic, table in tables.items()}
    return {topic: each.set_axis(each.index - start_s) for topic, each in delays.items() if each.any()}


def _figure(
    new_figure: Callable[..., Figure], title: str, panels: Mapping[str, Lines], scale: str = "linear"
) -> Figure:
    figure = new_figure(figsize=(9, 1.2 + 2.4 * len(panels)), layout="constrained")
    figure.suptitle(title)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for each, (label, lines) in zip(axes, panels.items(), strict=True):
        _draw(each, lines)
        each.set_ylabel(label)
        each.set_yscale(scale)
    axes[-1].set_xlabel("time [s]")
    return figure


def _draw(axes: Axes, lines: Lines) -> None:
    for name, line in lines.items():
        values = line.dropna()
        values = values.iloc[:: len(values) // MAX_POINTS + 1]
        axes.plot(values.index, values, label=name, linewidth=1.0)
    if len(lines) <= MAX_LINES:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
