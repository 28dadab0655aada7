"""Writes the report of a push: a table of the cycles, a summary, and pictures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from custom_ros_tools.plot_style import BLUE, GREEN, GREY, INK, ORANGE, PALE, SKY, X, Y, legend_beside, plot_style
from rpbi_mpc.loop import Cycle
from rpbi_mpc.pushing.planar.model import SliderConfig
from rpbi_mpc.records import summary_of, table_of

from .controller import PushingController
from .planar.motion import rotation

if TYPE_CHECKING:
    import pandas

OUTLINES = 12
"""Number of outlines of the slider in the picture of the path."""
AHEAD_S = (0.4, 1.2)
"""Prediction times at which the predicted and the actual position of the slider are compared [s]."""


@plot_style()
def write_report(folder: Path, cycles: Sequence[Cycle], controller: PushingController) -> dict[str, Any]:
    """Writes `cycles.csv`, `summary.json`, `path.png`, `errors.png` and `cycles.png` to a folder. Returns the summary.

    Errors are differences between the measured slider and the reference at the time of the measurement.

    Raises:
        OSError: If the folder cannot be written.
    """
    path = folder.expanduser()
    path.mkdir(parents=True, exist_ok=True)
    table = table_of(cycles, controller)
    table.to_csv(path / "cycles.csv", index=False)
    seen, outcome = table["error_m"].dropna() if "error_m" in table else [], controller.outcome
    summary = {
        **summary_of(table),
        "mean_error_mm": 1e3 * float(np.mean(seen)) if len(seen) else None,
        "largest_error_mm": 1e3 * float(np.max(seen)) if len(seen) else None,
        "finished": controller.is_finished,
        "failure": controller.failure,
        "goal_error_mm": _finite(1e3 * outcome.goal_m),
        "goal_error_deg": _finite(np.degrees(outcome.goal_rad)),
        "model_misfit": _finite(outcome.misfit),
        "model_face_mm": _finite(1e3 * outcome.face_m),
        "path_m": controller.path.length,
        "duration_s": float(table["time_s"].iloc[-1] - table["time_s"].iloc[0]) if len(table) else 0.0,
    }
    (path / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    if len(seen):
        _draw_path(path / "path.png", table, controller)
        _draw_errors(path / "errors.png", table, cycles, controller)
        _draw_cycles(path / "cycles.png", table, controller.config.slider)
    return summary


def _finite(value: float) -> float | None:
    """Returns a finite number unchanged, and None otherwise, since JSON lacks NaN."""
    return float(value) if np.isfinite(value) else None


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, sharex=rows > 1)


def _predicted(cycle: Cycle, ahead_s: float) -> np.ndarray:
    """Returns the slider's position x, y [m] that the plan of a cycle predicts. NaN without a prediction.

    Args:
        cycle: The cycle.
        ahead_s: Time after the start of the plan's first command [s].
    """
    plan = cycle.plan
    row = 0 if plan is None else round(ahead_s / plan.state_step_s)
    return np.full(2, np.nan) if plan is None or row >= len(plan.states) else plan.states[row, :2]


def _draw_path(file: Path, table: pandas.DataFrame, controller: PushingController) -> None:
    """Writes a picture of path, slider and pusher as seen from above."""
    figure, axes = _figure(1, 1, (8.5, 5.5))
    points = controller.path.points
    axes.plot(*points.T, color=GREEN, lw=2, label="path")
    seen = table.dropna(subset=["state.x"])
    axes.plot(seen["state.x"], seen["state.y"], color=ORANGE, lw=1.2, label="box")
    axes.plot(seen["measured.pusher_x"], seen["measured.pusher_y"], color=INK, lw=1, label="hand")
    rows = np.linspace(0, len(seen) - 1, OUTLINES).astype(int)
    poses = seen[["state.x", "state.y", "state.yaw"]].to_numpy()[rows]
    for pose in poses:
        axes.plot(*_outline(pose, controller.config.slider).T, color=ORANGE, alpha=0.3, lw=1)
    for name, pose, style in (("start", poses[0], ":"), ("end", poses[-1], "-")):
        axes.plot(*_outline(pose, controller.config.slider).T, color=ORANGE, ls=style, lw=2, label=f"box at the {name}")
        axes.annotate(name, pose[:2], (16, 0), textcoords="offset points", va="center", color=ORANGE)
    middle = len(points) // 2
    arrow = {"arrowstyle": "-|>", "color": GREEN, "lw": 2, "mutation_scale": 24}
    axes.annotate("", points[middle + len(points) // 20], points[middle], arrowprops=arrow)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    legend_beside(axes)
    figure.savefig(file, bbox_inches="tight")


def _draw_errors(file: Path, table: pandas.DataFrame, cycles: Sequence[Cycle], controller: PushingController) -> None:
    """Writes a picture with plots of the position, yaw and prediction errors over the distance along the path."""
    figure, axes = _figure(3, 1, (8.5, 6.0))
    along_m = table["path_time_s"].clip(upper=controller.path.duration_s) * controller.config.path.speed
    turned = table["state.yaw"] - table["reference_yaw"]
    axes[0].plot(along_m, 1e3 * table["error_m"], color=ORANGE)
    axes[0].set(ylabel="position error [mm]", ylim=(0.0, None))
    axes[1].plot(along_m, np.degrees(np.arctan2(np.sin(turned), np.cos(turned))), color=ORANGE)
    axes[1].axhline(0.0, color=GREY, lw=1)
    axes[1].set(ylabel="yaw error [deg]")
    for ahead_s, colour in zip(AHEAD_S, (BLUE, SKY)):
        then = table[["state.x", "state.y"]].shift(-round(ahead_s / controller.config.cycle_s)).to_numpy()
        missed = then - np.array([_predicted(cycle, ahead_s) for cycle in cycles])
        axes[2].plot(along_m, 1e3 * np.hypot(*missed.T), color=colour, label=f"{ahead_s:g} s ahead")
    axes[2].set(ylabel="prediction error [mm]", xlabel="along the path [m]", ylim=(0.0, None))
    legend_beside(axes[2])
    figure.savefig(file)


def _draw_cycles(file: Path, table: pandas.DataFrame, slider: SliderConfig) -> None:
    """Writes a picture with six plots over time: force, sliding, pusher position, pusher velocity, cost, solve time."""
    figure, axes = _figure(6, 1, (8.5, 10.5))
    time_s = table["time_s"] - table["time_s"].iloc[0]
    if "normal" in table:
        edge = 1e3 * slider.friction * table["normal"]
        axes[0].fill_between(time_s, -edge, edge, color=PALE, label="friction cone")
        axes[0].plot(time_s, 1e3 * table["tangential"], color=BLUE, label="tangential force")
        legend_beside(axes[0])
        axes[1].plot(time_s, 1e3 * table["sliding"], color=BLUE)
    axes[0].set(ylabel="force [mm/s]")
    axes[1].set(ylabel="sliding [mm/s]")
    axes[2].plot(time_s, 1e3 * table["contact"], color=BLUE)
    for side in (-1, 1):
        axes[2].axhline(side * 1e3 * slider.reach, color=GREY, ls="--", lw=1)
    axes[2].set(ylabel="pusher on face [mm]")
    axes[3].plot(time_s, 1e3 * table["command.pusher_vx"], color=X, label="x")
    axes[3].plot(time_s, 1e3 * table["command.pusher_vy"], color=Y, label="y")
    axes[3].set(ylabel="pusher [mm/s]")
    legend_beside(axes[3])
    axes[4].plot(time_s, table["cost"], color=GREEN)
    axes[4].set(ylabel="cost [-]", ylim=(0.0, None))
    axes[5].plot(time_s, 1e3 * table["wall_s"], color=GREY, label="wall clock")
    axes[5].plot(time_s, 1e3 * table["processor_s"], color=ORANGE, label="processor")
    axes[5].set(ylabel="solver [ms]", xlabel="time [s]", ylim=(0.0, None))
    legend_beside(axes[5])
    figure.savefig(file)


def _outline(pose: np.ndarray, slider: SliderConfig) -> np.ndarray:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * (slider.length / 2, slider.width / 2)
    outline: np.ndarray = pose[:2] + corners @ rotation(pose[2]).T
    return outline
