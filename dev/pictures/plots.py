"""Common style of the plots: size of text, colours of axes as in RViz, and legends outside of the data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from PIL import Image  # noqa: E402

X, Y, Z = "#d62728", "#2ca02c", "#1f77b4"
"""Colours of the axes x, y and z, as RViz has them: red, green, blue."""
GOOD, BAD = "#2ca02c", "#d62728"
DPI = 120
STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 11,
    "font.size": 11,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
}


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] = (9.0, 4.0), **subplots: Any
) -> tuple[Figure, list[Axes]]:
    """Returns a figure of `size` inches in the style of the pages, and its axes row by row.

    `subplots` are further arguments of `matplotlib.pyplot.subplots`.
    """
    plt.rcParams.update(STYLE)
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **subplots)
    return figure, list(axes.flat)


def empty_figure(size: tuple[float, float]) -> Figure:
    """Returns a figure of `size` inches in the style of the pages, without axes."""
    plt.rcParams.update(STYLE)
    return plt.figure(figsize=size, layout="constrained")


def show(axes: Axes, picture: Image.Image) -> None:
    """Shows a picture without ticks and frame."""
    axes.imshow(picture)
    axes.axis("off")


def legend_beside(axes: Axes) -> None:
    """Puts the legend to the right of the data."""
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def legend_below(figure: Figure, axes: Axes, columns: int = 1) -> None:
    """Puts the legend of one of the axes below all plots of the figure."""
    legend = figure.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=columns)
    share = legend.get_window_extent().height / figure.bbox.height
    figure.get_layout_engine().set(rect=(0.0, share, 1.0, 1.0 - share))


def save(figure: Figure, path: Path) -> None:
    """Writes the figure, and closes it."""
    figure.savefig(path, dpi=DPI)
    plt.close(figure)
