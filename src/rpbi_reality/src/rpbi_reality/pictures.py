"""Pictures of measured and simulated motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from custom_ros_tools.files import atomic_file

from .evaluation import PushResult, TossResult
from .pose_errors import angle_deg
from .pushes.push_data import mean_poses, times

REAL, SIMULATED = "0.35", "tab:orange"
_CORNERS = np.stack(np.meshgrid((-1, 1), (-1, 1), (-1, 1)), -1).reshape(-1, 3) * 0.5
_EDGES = [(i, j) for i in range(8) for j in range(i) if abs(_CORNERS[i] - _CORNERS[j]).sum() == 1.0]


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
            figure.savefig(part, dpi=100)
    return [folder / name for name in figures]


def toss_figure(result: TossResult) -> Figure:
    """Draws the real and the simulated cube from the side, and their distance and angle over time."""
    figure = Figure(figsize=(13, 10), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=[2.2, 1])
    for row, (name, index) in enumerate(chosen_tosses(result).items()):
        toss, (position, quaternion) = result.data.tosses[index], result.simulated(index)
        side = figure.add_subplot(grid[row, 0])
        along = toss.position[-1, :2] - toss.position[0, :2]
        along = along / max(float(np.linalg.norm(along)), 1e-9)
        frames = np.unique(np.linspace(0, len(toss.position) - 1, 7).astype(int))
        for frame in frames:
            _outline(side, along, toss.position[frame], toss.quaternion[frame], result.data.side, REAL)
            _outline(side, along, position[frame], quaternion[frame], result.data.side, SIMULATED)
        side.axhline(0.0, color="0.8", linewidth=1)
        side.plot([], color=REAL, label="measured")
        side.plot([], color=SIMULATED, label="simulated")
        side.set(aspect="equal", xlabel="along the toss [m]", ylabel="height [m]")
        side.set_title(f"{name}: toss {toss.name}, {result.errors.position[index]:.1f} % of the width", loc="left")
        side.legend(loc="upper right")
        errors = figure.add_subplot(grid[row, 1])
        time = np.arange(len(position)) / result.data.frame_rate
        distance = np.linalg.norm(position - toss.position, axis=1) / result.data.side * 100.0
        errors.plot(time, distance, color="tab:blue", label="position [% of the width]")
        errors.plot(time, angle_deg(quaternion, toss.quaternion), color="tab:red", label="rotation [deg]")
        errors.set(xlabel="time [s]", ylim=(0, None))
        errors.grid(alpha=0.3)
        errors.legend()
    return figure


def _outline(
    axes: object, along: np.ndarray, position: np.ndarray, quaternion: np.ndarray, side: float, color: str
) -> None:
    """Draws the edges of a cube, projected on the vertical plane through the direction `along`."""
    corners = Rotation.from_quat(quaternion).apply(_CORNERS * side) + position
    flat = np.stack([corners[:, :2] @ along, corners[:, 2]], 1)
    for i, j in _EDGES:
        axes.plot(*flat[[i, j]].T, color=color, linewidth=0.8)  # type: ignore[attr-defined]


def push_figure(result: PushResult) -> Figure:
    """Draws the hand's path, its error over time, and the cube's motion."""
    assert result.poses is not None
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    real, simulated, time = mean_poses([run.poses for run in result.runs]), result.poses, times(result.experiment)
    path, error, height, cube = figure.subplots(2, 2).ravel()
    for run in result.runs:
        path.plot(run.poses.hand_position[:, 0], run.poses.hand_position[:, 2], color="0.8", linewidth=0.7)
        distance = np.linalg.norm(run.poses.hand_position - real.hand_position, axis=1) * 1e3
        error.plot(time, distance, color="0.8", linewidth=0.7)
        cube.plot(time, run.poses.cube_position[:, 0], color="0.8", linewidth=0.7)
        height.plot(time, run.poses.hand_position[:, 2], color="0.8", linewidth=0.7)
    path.plot(real.hand_position[:, 0], real.hand_position[:, 2], color=REAL, label="measured, mean")
    path.plot(simulated.hand_position[:, 0], simulated.hand_position[:, 2], color=SIMULATED, label="simulated")
    path.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    path.set_title(f"experiment {result.experiment}: path of the hand", loc="left")
    path.legend()
    distance = np.linalg.norm(simulated.hand_position - real.hand_position, axis=1) * 1e3
    error.plot(time, distance, color=SIMULATED, label="simulated")
    error.plot([], color="0.8", label="each real run")
    error.set(xlabel="time [s]", ylabel="distance from the mean [mm]", ylim=(0, None))
    error.set_title("error of the hand", loc="left")
    error.legend()
    height.plot(time, real.hand_position[:, 2], color=REAL)
    height.plot(time, simulated.hand_position[:, 2], color=SIMULATED)
    height.set(xlabel="time [s]", ylabel="z of the hand [m]")
    cube.plot(time, real.cube_position[:, 0], color=REAL)
    cube.plot(time, simulated.cube_position[:, 0], color=SIMULATED)
    cube.set(xlabel="time [s]", ylabel="x of the cube [m]")
    for axes in (path, error, height, cube):
        axes.grid(alpha=0.3)
    return figure
