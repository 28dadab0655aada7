"""Common style of the plots: size of text, colours of axes as in RViz, and legends outside of the data."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

X, Y, Z = "#d62728", "#2ca02c", "#1f77b4"
"""Colours of the axes x, y and z, as RViz has them: red, green, blue."""
GOOD, BAD = "#2ca02c", "#d62728"
DPI = 120
STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.size": 11,
    "grid.alpha": 0.3,
    "lines.linewidth": 1.6,
}


def new_figure(rows: int = 1, columns: int = 1, size: tuple[float, float] = (9.0, 4.0)) -> tuple[Figure, list[Axes]]:
    """Returns a figure of `size` inches in the style of the pages, and its axes row by row."""
    plt.rcParams.update(STYLE)
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False)
    return figure, list(axes.flat)


def legend_beside(axes: Axes) -> None:
    """Puts the legend to the right of the data."""
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def save(figure: Figure, path: Path) -> None:
    """Writes the figure, and closes it."""
    figure.savefig(path, dpi=DPI)
    plt.close(figure)
