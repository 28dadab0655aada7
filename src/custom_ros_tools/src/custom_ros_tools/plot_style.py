"""Common style of plots: colours for readers of any colour vision, text, lines, resolution, legends next to the data.

The colours are those of Okabe and Ito, "Color Universal Design", 2008.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"
INK, GREY, PALE = "#22333f", "#7d8a94", "#dfe4e8"
X, Y, Z = ORANGE, GREEN, BLUE
"""Colours of the axes x, y and z: close to the red, green and blue of RViz."""
STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": GREY,
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "font.family": ["Liberation Sans", "DejaVu Sans"],
    "font.size": 11,
    "grid.color": PALE,
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    "lines.linewidth": 1.8,
    "lines.solid_capstyle": "round",
    "savefig.dpi": 200,
    "text.color": INK,
    "xtick.color": INK,
    "xtick.major.size": 0,
    "ytick.color": INK,
    "ytick.major.size": 0,
}
"""Parameters of matplotlib. A figure of 9 inches has 1800 columns: twice those that the pages show."""
LINE_HEIGHT = 1.25
"""Least distance of two names next to a plot, in heights of their letters."""


@contextmanager
def plot_style() -> Iterator[None]:
    """Draws and saves figures in this style, in a `with` block or in a decorated function."""
    import logging

    import matplotlib
    from cycler import cycler

    logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)  # a missing font has a substitute
    cycle = cycler(color=[BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW, INK])
    with matplotlib.rc_context({**STYLE, "axes.prop_cycle": cycle}):
        yield


def legend_beside(axes: Axes, **options: Any) -> None:
    """Puts the legend to the right of the data; `options` are those of `Axes.legend`."""
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), **options)


def legend_below(figure: Figure, axes: Axes, columns: int = 1) -> None:
    """Puts the legend of one of the axes below all plots of a figure with constrained layout."""
    legend = figure.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=columns)
    share = legend.get_window_extent().height / figure.bbox.height + 0.01
    figure.get_layout_engine().set(rect=(0.0, share, 1.0, 1.0 - share))


def name_lines(axes: Axes) -> None:
    """Writes the label of each line at its right end, in its colour, instead of a legend."""
    lines = [line for line in axes.get_lines() if len(line.get_ydata()) and not str(line.get_label()).startswith("_")]
    to_axes = axes.transData + axes.transAxes.inverted()
    ends = [(float(to_axes.transform((0.0, line.get_ydata()[-1]))[1]), line) for line in lines]
    row = LINE_HEIGHT * 11.0 / 72.0 * axes.figure.dpi / axes.get_window_extent().height
    lowest = -1.0
    for height, line in sorted(ends, key=lambda end: end[0]):
        lowest = max(height, lowest + row)
        axes.annotate(
            str(line.get_label()),
            (1.0, lowest),
            (6, 0),
            xycoords="axes fraction",
            textcoords="offset points",
            color=line.get_color(),
            va="center",
            annotation_clip=False,
        )
