"""Pictures of measured and simulated motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from custom_ros_tools.files import atomic_file
from custom_ros_tools.plot_style import GREY, INK, ORANGE, legend_below, plot_style

from .evaluation import PushResult, TossResult
from .pose_errors import angle_deg
from .pushes.push_data import mean_poses, times

REAL, SIMULATED, EACH_RUN = GREY, ORANGE, "#c3cbd1"
_CORNERS = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), -1).reshape(-1, 3) * 0.5
_SHOWN = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Parts of the cube's way at which it is drawn."""


def chosen_tosses(result: TossResult) -> dict[str, int]:
    """Returns the index of the best, the median and the worst toss, by the error of position."""
    order = np.argsort(result.errors.position)
    return {"best": int(order[0]), "median": int(order[len(order) // 2]), "worst": int(order[-1])}


def write_pictures(folder: Path, tosses: TossResult | None, pushes: list[PushResult]) -> list[Path]:
    """Writes a picture of the tosses, and one of each experiment of the arm; returns the files."""
    figures = {} if tosses is None else {"tosses.png": toss_figure(tosses)}
    for each in pushes:
        if each.poses is not None:
            figures[f"pushes_{each.experiment}.png"] = push_figure(each)
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        with atomic_file(folder / name) as part:
            figure.savefig(part, dpi=200)
    return [folder / name for name in figures]


@plot_style()
def toss_figure(result: TossResult) -> Figure:
    """Draws the real and the simulated cube from the side, and the errors of position and rotation over time."""
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    rows = figure.subplots(3, 3, width_ratios=[2.4, 1, 1])
    for (side, distance, angle), (name, index) in zip(rows, chosen_tosses(result).items()):
        toss, (position, quaternion) = result.data.tosses[index], result.simulated(index)
        along = toss.position[-1, :2] - toss.position[0, :2]
        along = along / max(float(np.linalg.norm(along)), 1e-9)
        for frame in _frames(toss.position):
            real = _outline(along, toss.position[frame], toss.quaternion[frame], result.data.side)
            simulated = _outline(along, position[frame], quaternion[frame], result.data.side)
            measured = side.add_patch(Polygon(real, facecolor=REAL, alpha=0.35, edgecolor="none"))
            cube = side.add_patch(Polygon(simulated, fill=False, edgecolor=SIMULATED, linewidth=1.5))
        measured.set_label("measured cube")
        cube.set_label("simulated cube")
        side.axhline(0.0, color=INK, linewidth=1)
        side.set(aspect="equal", ylabel="height [m]")
        side.autoscale_view()
        side.set_title(f"{name} of {len(result.data.tosses)}: toss {toss.name}")
        time = np.arange(len(position)) / result.data.frame_rate
        distance.plot(time, np.linalg.norm(position - toss.position, axis=1) / result.data.side * 100.0)
        distance.set(ylabel="% of the width", ylim=(0, None))
        distance.set_title(f"position: {result.errors.position[index]:.1f} %")
        angle.plot(time, angle_deg(quaternion, toss.quaternion))
        angle.set(ylabel="deg", ylim=(0, None))
        angle.set_title(f"rotation: {result.errors.rotation[index]:.1f} deg")
    for axes, label in zip(rows[-1], ("along the toss [m]", "time [s]", "time [s]")):
        axes.set_xlabel(label)
    legend_below(figure, rows[0, 0], 2)
    return figure


def _frames(position: np.ndarray) -> list[int]:
    """Returns the frames at which the cube has gone the parts `_SHOWN` of its way."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    return [int(np.searchsorted(way, part * way[-1])) for part in _SHOWN]


def _outline(along: np.ndarray, position: np.ndarray, quaternion: np.ndarray, side: float) -> np.ndarray:
    """Returns the outline of a cube, projected on the vertical plane through the direction `along`; shape (n, 2)."""
    corners = Rotation.from_quat(quaternion).apply(_CORNERS * side) + position
    flat = np.stack([corners[:, :2] @ along, corners[:, 2]], 1)
    return flat[ConvexHull(flat).vertices]


@plot_style()
def push_figure(result: PushResult) -> Figure:
    """Draws the hand's path, its error over time, and the cube's motion."""
    assert result.poses is not None
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    real, simulated, time = mean_poses([run.poses for run in result.runs]), result.poses, times(result.experiment)
    path, error, height, cube = figure.subplots(2, 2).ravel()
    views = [
        (path, lambda poses: (poses.hand_position[:, 0], poses.hand_position[:, 2])),
        (error, lambda poses: (time, np.linalg.norm(poses.hand_position - real.hand_position, axis=1) * 1e3)),
        (height, lambda poses: (time, poses.hand_position[:, 2])),
        (cube, lambda poses: (time, poses.cube_position[:, 0])),
    ]
    for axes, curve in views:
        for run in result.runs:
            (each,) = axes.plot(*curve(run.poses), color=EACH_RUN, linewidth=1.2)
        each.set_label(f"each of {len(result.runs)} measured runs")
        if axes is not error:
            axes.plot(*curve(real), color=INK, linewidth=3.5, label="their mean")
        axes.plot(*curve(simulated), color=SIMULATED, linewidth=1.5, label="simulated")
    path.set(title="path of the hand", aspect="equal", xlabel="x [m]", ylabel="z [m]")
    error.set(title="distance of the hand from the measured mean", xlabel="time [s]", ylabel="mm", ylim=(0, None))
    height.set(title="height of the hand", xlabel="time [s]", ylabel="z [m]")
    cube.set(title="position of the cube", xlabel="time [s]", ylabel="x [m]")
    legend_below(figure, path, 3)
    return figure
