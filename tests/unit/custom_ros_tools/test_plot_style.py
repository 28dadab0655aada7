"""The style of plots: names at the ends of lines, and colours and sizes only inside of the block."""

from __future__ import annotations

from itertools import combinations

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from custom_ros_tools.plot_style import BLUE, legend_beside, name_lines, plot_style

ENDS = {"x": 0.50, "y": 0.51, "z": 0.52, "far": 0.0}


def axes_with_lines() -> Axes:
    """Returns axes with lines whose right ends are too near to each other for names."""
    figure = Figure(figsize=(8.0, 4.0))
    FigureCanvasAgg(figure)
    axes: Axes = figure.subplots()
    for name, end in ENDS.items():
        axes.plot([0.0, 1.0], [0.0, end], label=name)
    return axes


def overlaps(axes: Axes) -> list[tuple[str, str]]:
    """Returns the pairs of texts that cover each other."""
    axes.figure.canvas.draw()
    pairs = combinations(axes.texts, 2)
    return [(a.get_text(), b.get_text()) for a, b in pairs if a.get_window_extent().overlaps(b.get_window_extent())]


def test_names_of_near_lines_do_not_overlap() -> None:
    with plot_style():
        axes = axes_with_lines()
        name_lines(axes)
        assert {each.get_text() for each in axes.texts} == set(ENDS) and overlaps(axes) == []
        assert [each.get_color() for each in axes.texts if each.get_text() == "x"] == [BLUE]


def test_names_at_the_ends_themselves_overlap() -> None:
    with plot_style():
        axes = axes_with_lines()
        for name, end in ENDS.items():
            axes.annotate(name, (1.0, end))
        assert ("x", "y") in overlaps(axes)


def test_legend_is_to_the_right_of_the_data() -> None:
    with plot_style():
        axes = axes_with_lines()
        legend_beside(axes)
        axes.figure.canvas.draw()
        legend = axes.get_legend()
        assert legend is not None and legend.get_window_extent().x0 > axes.get_window_extent().x1


def test_style_ends_with_the_block() -> None:
    before = matplotlib.rcParams["axes.grid"], matplotlib.rcParams["savefig.dpi"]
    with plot_style():
        assert (matplotlib.rcParams["axes.grid"], matplotlib.rcParams["savefig.dpi"]) == (True, 200) != before
    assert (matplotlib.rcParams["axes.grid"], matplotlib.rcParams["savefig.dpi"]) == before
