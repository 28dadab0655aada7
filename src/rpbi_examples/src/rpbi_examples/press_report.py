"""Evaluates one press of an arm's tool on a box: the errors of the forces, a table, and a figure."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.plot_style import BLUE, INK, ORANGE, PURPLE, YELLOW, legend_beside, plot_style

TOUCHED_M = 0.001
"""Least depth of the tool in the box that counts as contact [m]."""
RELEASED_S = 0.5
"""Time without contact after which a press is over [s]."""
MIN_PRESS_S = 0.3
"""Least duration of a press that is evaluated [s]."""
MAX_GAP_S = 0.05
"""Longest time between two samples [s]. A longer gap is a pause of the simulator, and is left out of the means."""
MIN_SHARE = 0.5
"""Least share of a press's duration that must be free of pauses."""


class PressSample(NamedTuple):
    """State of handle and tool at one time.

    Attributes:
        time_s: Time since the start [s].
        handle_z: Height of the handle of the haptic device [m].
        target_z: Target height of the tool in the world [m].
        tool_z: Height of the tool in the world [m].
        measured_n: Force on the tool along z, measured by the sensor in the wrist [N].
        felt_n: Force on the handle along z [N].
    """

    time_s: float
    handle_z: float
    target_z: float
    tool_z: float
    measured_n: float
    felt_n: float


class PressReport(NamedTuple):
    """Result of one press, from first to last contact.

    All means are over time. For any motion, the mean force on the tool equals stiffness times mean depth, since the
    effects of damping and inertia cancel out between pressing and releasing.

    Attributes:
        duration_s: Time from the first to the last contact [s].
        depth_m: Mean depth of the tool in the box [m].
        measured_n: Mean force on the tool [N].
        predicted_n: Stiffness times mean depth [N].
        scatter_n: Root mean square of the difference between the force on the tool and stiffness times depth [N].
        felt_n: Mean force on the handle [N].
        expected_n: Mean force on the tool times the force scale [N].
        peak_n: Largest force on the handle [N].
    """

    duration_s: float
    depth_m: float
    measured_n: float
    predicted_n: float
    scatter_n: float
    felt_n: float
    expected_n: float
    peak_n: float

    @property
    def error(self) -> float:
        """Relative error of the mean force on the tool. The reference is stiffness times mean depth."""
        return abs(self.measured_n - self.predicted_n) / self.predicted_n

    @property
    def felt_error(self) -> float:
        """Relative error of the mean force on the handle. The reference is the scaled mean force on the tool."""
        return abs(self.felt_n - self.expected_n) / self.expected_n

    def __str__(self) -> str:
        tool = f"{self.measured_n:.2f} N on the tool, by stiffness {self.predicted_n:.2f} N ({self.error:.1%} off)"
        handle = f"{self.felt_n:.2f} N on the handle, by scale {self.expected_n:.2f} N ({self.felt_error:.1%} off)"
        return (
            f"mean of the press of {self.duration_s:.1f} s at a depth of {self.depth_m * 1e3:.1f} mm: {tool}, "
            f"scattered by {self.scatter_n:.2f} N; {handle}, at most {self.peak_n:.2f} N"
        )


class Press:
    """Collects the samples of one press, and evaluates the press.

    Args:
        stiffness: Stiffness of the box [N/m].
        force_scale: Ratio of the force on the handle to the force on the tool.
        touch_height: Height of the tool at which the tool touches the box [m].
    """

    def __init__(self, stiffness: float, force_scale: float, touch_height: float) -> None:
        self._stiffness, self._force_scale, self._touch_height = stiffness, force_scale, touch_height
        self.samples: list[PressSample] = []
        self._has_touched = False
        self._released_s = 0.0

    def add(self, sample: PressSample) -> None:
        """Adds a sample, which must be newer than all earlier samples."""
        if self._depth_m(sample) > TOUCHED_M:
            self._has_touched, self._released_s = True, sample.time_s
        self.samples.append(sample)

    @property
    def is_over(self) -> bool:
        """Whether the tool has touched the box and has been released for `RELEASED_S`."""
        return self._has_touched and self.samples[-1].time_s - self._released_s > RELEASED_S

    def report(self) -> PressReport | None:
        """Evaluates the press. Returns None if the press was too short, or if the simulator mostly paused; see
        `MIN_PRESS_S` and `MIN_SHARE`.
        """
        times_s, depths_m, measured_n, felt_n = np.array(
            [(each.time_s, self._depth_m(each), each.measured_n, each.felt_n) for each in self.samples]
        ).T
        touching = np.flatnonzero(depths_m > TOUCHED_M)
        if not touching.size or times_s[touching[-1]] - times_s[touching[0]] < MIN_PRESS_S:
            return None
        duration_s = float(times_s[touching[-1]] - times_s[touching[0]])
        gaps_s = np.diff(times_s, prepend=times_s[0])
        counted = (depths_m > 0.0) & (gaps_s <= MAX_GAP_S)
        counted[: touching[0]] = counted[touching[-1] + 1 :] = False
        weights_s = gaps_s * counted
        if weights_s.sum() < MIN_SHARE * duration_s:
            return None

        def mean(values: NDArray[np.float64]) -> float:
            return float(np.average(values, weights=weights_s))

        off_n = measured_n - self._stiffness * depths_m
        return PressReport(
            duration_s,
            mean(depths_m),
            mean(measured_n),
            self._stiffness * mean(depths_m),
            math.sqrt(mean(off_n**2)),
            mean(felt_n),
            self._force_scale * mean(measured_n),
            max(abs(each.felt_n) for each in self.samples),
        )

    def _depth_m(self, sample: PressSample) -> float:
        return self._touch_height - sample.tool_z

    def write_table(self, path: Path) -> None:
        """Writes all samples to a CSV file."""
        with open(path, "w", newline="") as file:
            table = csv.writer(file)
            table.writerow(PressSample._fields)
            table.writerows([f"{value:.6f}" for value in sample] for sample in self.samples)

    @plot_style()
    def draw(self, figure: object) -> None:
        """Draws forces and heights over time.

        Args:
            figure: A `matplotlib.figure.Figure`, whose content is replaced.
        """
        figure.clear()  # type: ignore[attr-defined]
        upper, lower = figure.subplots(2, 1, sharex=True)  # type: ignore[attr-defined]
        times_s = [each.time_s for each in self.samples]
        forces = {"on the tool,\nmeasured in the wrist": "measured_n", "on the handle,\nfelt by the hand": "felt_n"}
        for (label, name), colour in zip(forces.items(), (ORANGE, PURPLE)):
            upper.plot(times_s, [getattr(each, name) for each in self.samples], color=colour, label=label)
        upper.set_ylabel("force upwards [N]")
        lower.plot(times_s, [1e3 * each.tool_z for each in self.samples], color=BLUE, label="tool")
        lower.plot(times_s, [1e3 * each.target_z for each in self.samples], "--", color=INK, label="its target")
        low_mm, touch_mm = lower.get_ylim()[0], 1e3 * self._touch_height
        lower.axhspan(low_mm, touch_mm, color=YELLOW, alpha=0.15, lw=0, label="tool in the box")
        lower.set_ylim(bottom=low_mm)
        lower.set_ylabel("height [mm]")
        lower.set_xlabel("time [s]")
        for axes in (upper, lower):
            legend_beside(axes)

    @plot_style()
    def write_figure(self, path: Path) -> None:
        """Draws the press, and writes the figure to a PNG file."""
        from matplotlib.figure import Figure  # importing it takes half a second; other callers need not wait for it

        figure = Figure(figsize=(9.0, 5.0), layout="constrained")
        self.draw(figure)
        figure.savefig(path)
