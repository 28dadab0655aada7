"""Draws a motion through waypoints over time: position and speed of the plan and of an arm's tip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from custom_ros_tools.plot_style import GREY, INK, X, Y, Z, legend_beside, plot_style
from custom_ros_tools.transforms import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

PLAN, TIP = {"lw": 4.0, "alpha": 0.35}, {"lw": 1.4}
"""Lines of the plan, which is wide and pale, and of the tip."""


@plot_style()
def draw_motion(
    figure: Figure | SubFigure,
    rows: Sequence[tuple[float, Array, Array]],
    times_s: Sequence[float],
    waypoints: Array,
) -> None:
    """Draws positions in the upper plot, and speeds in the lower plot.

    Args:
        figure: Empty figure.
        rows: Time since the start [s], and the positions x, y, z of plan and tip [m].
        times_s: Times of the n waypoints [s].
        waypoints: Positions of the waypoints, shape (3, n) [m].
    """
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    seconds = np.array([row[0] for row in rows])
    for index, (style, name) in enumerate(((PLAN, "plan"), (TIP, "tip")), 1):
        places = np.array([row[index] for row in rows])
        for axis, place, colour in zip("xyz", places.T, (X, Y, Z)):
            upper.plot(seconds, place, color=colour, label=axis if name == "tip" else None, **style)
        speed = np.linalg.norm(np.gradient(places, seconds, axis=0), axis=1)
        lower.plot(seconds, speed, color=INK, label=name, **style)
    upper.plot(times_s, waypoints[0], "o", color=INK, label="waypoints")
    upper.plot(times_s, waypoints[1:].T, "o", color=INK)
    upper.set(ylabel="position [m]")
    lower.set(ylabel="speed [m/s]", xlabel="time [s]", ylim=(0.0, None))
    for axes in (upper, lower):
        _finish(axes, times_s)


def _finish(axes: Axes, times_s: Sequence[float]) -> None:
    for time_s in times_s:
        axes.axvline(time_s, color=GREY, lw=1.0, ls=":")
    legend_beside(axes)
