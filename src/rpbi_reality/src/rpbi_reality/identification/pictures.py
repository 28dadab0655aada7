"""Pictures of identified parameters."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from custom_ros_tools.plot_style import BLUE, ORANGE, plot_style

from .fit_config import FitConfig
from .uncertainty import Uncertainty


@plot_style()
def parameter_picture(config: FitConfig, values: Mapping[str, float], found: Uncertainty) -> Figure:
    """Draws each parameter with its interval within its bounds, and the profiles of the two least certain ones."""
    figure = Figure(figsize=(10, 1.2 + 0.45 * len(values) + 2.6), layout="constrained")
    rows = figure.add_gridspec(2, 2, height_ratios=[0.45 * len(values) + 0.6, 2.4])
    axes = figure.add_subplot(rows[0, :])
    for row, (name, value) in enumerate(reversed(list(values.items()))):
        low, high = config.parameters[name].bounds
        interval = [(each - low) / (high - low) for each in found.intervals[name]]
        place = (value - low) / (high - low)
        axes.plot(interval, [row, row], color=BLUE, linewidth=5, alpha=0.4, solid_capstyle="butt")
        axes.plot([place], [row], "o", color=BLUE)
        axes.text(
            1.02, row, f"{value:.4g}  [{found.intervals[name][0]:.4g}, {found.intervals[name][1]:.4g}]", va="center"
        )
        axes.text(-0.02, row, name, ha="right", va="center")
    axes.set(xlim=(0, 1), ylim=(-0.7, len(values) - 0.3), yticks=[], xlabel="value within the bounds, 95 % interval")
    axes.grid(False, axis="y")
    for column, (name, points) in enumerate(found.profiles.items()):
        below = figure.add_subplot(rows[1, column])
        below.plot([x for x, _ in points], [y for _, y in points], "o-", color=ORANGE, markersize=3)
        below.axvline(values[name], color=BLUE, linewidth=1)
        below.set(xlabel=name, ylabel="increase of the error")
    return figure
