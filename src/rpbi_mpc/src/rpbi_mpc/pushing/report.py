"""The report of a push: table, figures and pictures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rpbi_mpc.loop import Cycle
from rpbi_mpc.records import summary_of, table_of

from .controller import PushingController
from .planar.motion import rotation
from .planar.slider import SliderConfig

if TYPE_CHECKING:
    import pandas

OUTLINES = 12
"""Number of outlines of the slider in the picture of the path."""


def write_report(folder: Path, cycles: Sequence[Cycle], controller: PushingController) -> dict[str, Any]:
    """Writes `cycles.csv`, `summary.json`, `path.png` and `cycles.png` to a folder; returns the summary.

    Errors are those of the estimated slider, when the command of a cycle acts, to the reference of that time.

    Raises:
        OSError: If the folder cannot be written.
    """
    path = folder.expanduser()
    path.mkdir(parents=True, exist_ok=True)
    table = table_of(cycles, controller)
    table["error_m"] = _errors(table)
    table.to_csv(path / "cycles.csv", index=False)
    seen = table["error_m"].dropna()
    summary = {
        **summary_of(table),
        "mean_error_mm": 1e3 * float(seen.mean()) if len(seen) else None,
        "largest_error_mm": 1e3 * float(seen.max()) if len(seen) else None,
        "finished": controller.is_finished,
        "path_m": controller.path.length,
        "duration_s": float(table["time_s"].iloc[-1] - table["time_s"].iloc[0]) if len(table) else 0.0,
    }
    (path / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    if len(seen):
        _draw_path(path / "path.png", table, controller)
        _draw_cycles(path / "cycles.png", table, controller.config.slider)
    return summary


def _errors(table: pandas.DataFrame) -> Any:
    """Returns distances of the slider from the reference [m]; NaN where there was no measurement."""
    if "reference_x" not in table:
        return np.full(len(table), np.nan)
    return np.hypot(table["state.x"] - table["reference_x"], table["state.y"] - table["reference_y"])


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, sharex=rows > 1)


def _draw_path(file: Path, table: pandas.DataFrame, controller: PushingController) -> None:
    """Draws path, slider and pusher from above."""
    figure, axes = _figure(1, 1, (7.0, 5.5))
    points = controller.path.points
    axes.plot(*points.T, color="tab:green", lw=2, label="path")
    seen = table.dropna(subset=["state.x"])
    axes.plot(seen["state.x"], seen["state.y"], color="tab:orange", label="slider")
    axes.plot(seen["measured.pusher_x"], seen["measured.pusher_y"], color="0.4", lw=1, label="pusher")
    for row in seen.iloc[np.linspace(0, len(seen) - 1, OUTLINES).astype(int)].itertuples(index=False):
        record = dict(zip(seen.columns, row))
        outline = _outline(np.array([record[f"state.{name}"] for name in ("x", "y", "yaw")]), controller.config.slider)
        axes.plot(*outline.T, color="tab:orange", alpha=0.45, lw=1)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(loc="best")
    figure.savefig(file, dpi=120)


def _draw_cycles(file: Path, table: pandas.DataFrame, slider: SliderConfig) -> None:
    """Draws error, place of the pusher, its velocity, and solve times over time."""
    figure, axes = _figure(4, 1, (7.0, 8.0))
    time_s = table["time_s"] - table["time_s"].iloc[0]
    axes[0].plot(time_s, 1e3 * table["error_m"], color="tab:orange")
    axes[0].set(ylabel="error [mm]", ylim=(0.0, None))
    axes[1].plot(time_s, 1e3 * table["contact"], color="tab:blue")
    for side in (-1, 1):
        axes[1].axhline(side * 1e3 * slider.reach, color="0.6", ls="--", lw=1)
    axes[1].set(ylabel="pusher on face [mm]")
    axes[2].plot(time_s, 1e3 * table["command.pusher_vx"], label="x")
    axes[2].plot(time_s, 1e3 * table["command.pusher_vy"], label="y")
    axes[2].set(ylabel="pusher [mm/s]")
    axes[2].legend(loc="upper right")
    axes[3].plot(time_s, 1e3 * table["wall_s"], color="0.7", label="wall clock")
    axes[3].plot(time_s, 1e3 * table["processor_s"], color="tab:red", label="processor")
    axes[3].set(ylabel="solver [ms]", xlabel="time [s]", ylim=(0.0, None))
    axes[3].legend(loc="upper right")
    figure.savefig(file, dpi=120)


def _outline(pose: np.ndarray, slider: SliderConfig) -> np.ndarray:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * (slider.length / 2, slider.width / 2)
    outline: np.ndarray = pose[:2] + corners @ rotation(pose[2]).T
    return outline
