"""Figures in the common style of plots, pictures in them, and legends below them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
from files import give_palette, write_png  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from PIL import Image  # noqa: E402

from custom_ros_tools.plot_style import GREEN, ORANGE, plot_style  # noqa: E402

GOOD, BAD = GREEN, ORANGE
_STYLE = plot_style()
_STYLE.__enter__()  # until the process ends, since it draws one picture


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] = (9.0, 4.0), **subplots: Any
) -> tuple[Figure, list[Axes]]:
    """Returns a figure of `size` inches in the style of the pages, and its axes row by row.

    `subplots` are further arguments of `matplotlib.pyplot.subplots`.
    """
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **subplots)
    return figure, list(axes.flat)


def empty_figure(size: tuple[float, float]) -> Figure:
    """Returns a figure of `size` inches in the style of the pages, without axes."""
    return plt.figure(figsize=size, layout="constrained")


def show(axes: Axes, picture: Image.Image) -> None:
    """Shows a picture without ticks and frame."""
    axes.imshow(picture)
    axes.axis("off")


def save(figure: Figure, path: Path, has_photographs: bool = False) -> None:
    """Writes the figure with a palette, so that the file is small, and closes it.

    Args:
        figure: The figure.
        path: The PNG file.
        has_photographs: Whether the figure shows renders, whose gradients need dithering.
    """
    figure.savefig(path)
    plt.close(figure)
    if has_photographs:
        with Image.open(path) as picture:
            write_png(path, picture.convert("RGB"), dither=True)
    else:
        give_palette(path)
