"""One press and release of an arm on a box: its figure, its table, and whether the force is what it should be."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

TOUCHED_M = 0.001
"""From this depth on the tool counts as touching [m]."""
RELEASED_S = 0.5
"""A press is over when the tool has not touched for so long [s]."""
STEADY_S = 0.3
"""How long the force is looked at where it is steadiest [s]."""


class Sample(NamedTuple):
    """What there was at one moment.

    Attributes:
        time_s: Since the start [s].
        handle_z: Height of the handle [m].
        target_z: Height that the tool is to have in the world [m].
        tool_z: Height of the tool [m].
        measured_n: Force on the tool along z, by its sensor [N].
        felt_n: Force on the handle along z [N].
    """

    time_s: float
    handle_z: float
    target_z: float
    tool_z: float
    measured_n: float
    felt_n: float


class PressReport(NamedTuple):
    """How a press went.

    Attributes:
        depth_m: How deep the tool was in the box, where the force was steadiest [m].
        measured_n: Force on the tool then [N].
        felt_n: Force on the handle then [N].
        predicted_n: Stiffness times depth [N].
        expected_n: The same on the handle, by the scale of the force [N].
        peak_n: Largest force on the handle [N].
    """

    depth_m: float
    measured_n: float
    felt_n: float
    predicted_n: float
    expected_n: float
    peak_n: float

    @property
    def error(self) -> float:
        """How far the force on the tool is from what stiffness and depth predict, as a share of that."""
        return abs(self.measured_n - self.predicted_n) / self.predicted_n

    @property
    def felt_error(self) -> float:
        """The same of the force on the handle."""
        return abs(self.felt_n - self.expected_n) / self.expected_n

    def __str__(self) -> str:
        tool = f"{self.measured_n:.2f} N on the tool, by stiffness {self.predicted_n:.2f} N ({self.error:.1%} off)"
        handle = f"{self.felt_n:.2f} N on the handle, by scale {self.expected_n:.2f} N ({self.felt_error:.1%} off)"
        return f"steady force at a depth of {self.depth_m * 1e3:.1f} mm: {tool}; {handle}, at most {self.peak_n:.2f} N"


class Press:
    """Collects what happens until the tool has been pressed and released.

    Args:
        stiffness: Of the box [N/m].
        force_scale: Force on the handle for each newton on the tool.
        touch_height: Height of the tool at which it touches the box [m].
    """

    def __init__(self, stiffness: float, force_scale: float, touch_height: float) -> None:
        self._stiffness, self._force_scale, self._touch_height = stiffness, force_scale, touch_height
        self.samples: list[Sample] = []
        self._has_touched = False
        self._released_s = 0.0

    def add(self, sample: Sample) -> None:
        """Takes what there is now."""
        if self._depth_m(sample) > TOUCHED_M:
            self._has_touched, self._released_s = True, sample.time_s
        self.samples.append(sample)

    @property
    def is_over(self) -> bool:
        """Whether the tool has been pressed and released."""
        return self._has_touched and self.samples[-1].time_s - self._released_s > RELEASED_S

    def report(self) -> PressReport | None:
        """Returns how it went; None if the tool was not pressed for `STEADY_S`."""
        touching = [each for each in self.samples if self._depth_m(each) > TOUCHED_M]
        if not touching or touching[-1].time_s - touching[0].time_s < STEADY_S:
            return None
        deepest_m = max(map(self._depth_m, touching))
        windows, first = [], 0
        for last, sample in enumerate(touching):
            while sample.time_s - touching[first].time_s > STEADY_S:
                first += 1
            if first and min(self._depth_m(each) for each in touching[first : last + 1]) > 0.5 * deepest_m:
                windows.append(touching[first : last + 1])
        if not windows:
            return None
        steady = min(windows, key=_unsteadiness)
        depth_m = float(np.median([self._depth_m(each) for each in steady]))
        return PressReport(
            depth_m,
            float(np.median([each.measured_n for each in steady])),
            float(np.median([each.felt_n for each in steady])),
            self._stiffness * depth_m,
            self._force_scale * self._stiffness * depth_m,
            max(abs(each.felt_n) for each in self.samples),
        )

    def _depth_m(self, sample: Sample) -> float:
        return self._touch_height - sample.tool_z

    def write_table(self, path: Path) -> None:
        """Writes all samples as CSV."""
        with open(path, "w", newline="") as file:
            table = csv.writer(file)
            table.writerow(Sample._fields)
            table.writerows([f"{value:.6f}" for value in sample] for sample in self.samples)

    def draw(self, figure: object) -> None:
        """Draws force and heights over time.

        Args:
            figure: A `matplotlib.figure.Figure`; what it has is replaced.
        """
        figure.clear()  # type: ignore[attr-defined]
        upper, lower = figure.subplots(2, 1, sharex=True)  # type: ignore[attr-defined]
        times_s = [each.time_s for each in self.samples]
        upper.plot(times_s, [each.felt_n for each in self.samples], color="tab:red", label="felt at the handle")
        upper.plot(
            times_s, [each.measured_n for each in self.samples], "--", color="tab:gray", label="measured at the wrist"
        )
        upper.set_ylabel("force along z [N]")
        lower.plot(times_s, [1e3 * each.target_z for each in self.samples], "--", color="tab:gray", label="target")
        lower.plot(times_s, [1e3 * each.tool_z for each in self.samples], color="tab:blue", label="tool")
        lower.axhline(1e3 * self._touch_height, color="tab:green", linewidth=1, label="box")
        lower.set_ylabel("height [mm]")
        lower.set_xlabel("time [s]")
        for axes in (upper, lower):
            axes.grid(alpha=0.3)
            axes.legend(loc="upper right")

    def write_figure(self, path: Path) -> None:
        """Writes the figure as PNG."""
        from matplotlib.figure import Figure  # takes half a second, which nobody else has to wait for

        figure = Figure(figsize=(7.0, 5.0), dpi=120, layout="tight")
        self.draw(figure)
        figure.savefig(path)


def _unsteadiness(window: list[Sample]) -> float:
    """Returns how much both forces change [N]."""
    return float(sum(np.std([getattr(each, name) for each in window]) for name in ("measured_n", "felt_n")))
