"""Runs an episode of the scene `wiping`, and draws the sponge's force along the path and the wiped area.

.venv/bin/python -m rpbi_examples.scenes.wiping_plot --seed 3 --out wiping.png
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from custom_ros_tools.plot_style import BLUE, GREY, PALE, legend_beside, plot_style

from .parts.lanes import ways_along
from .scene import SceneResult
from .task import SceneTask, make_env, run_episode
from .wiping import SIZE_M, STAIN_M, TOLERANCE, Wiping

STAIN, WIPED = "#29479e", "#cfe8dd"


@plot_style()
def draw(scene: Wiping, result: SceneResult, title: str, file: Path) -> None:
    """Writes a picture of an episode that has ended: the force in the upper plot, the board in the lower plot."""
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    force, board = figure.subplots(2, 1, height_ratios=(2, 3))
    figure.suptitle(f"{title}: {'succeeded' if result.success else f'failed {result.reason}'}")
    draw_force(scene, force, result.figures["way within 10 % [%]"])
    draw_board(scene, board, result.figures["coverage [%]"])
    figure.savefig(file)


def draw_force(scene: Wiping, axes: Axes, share: float) -> None:
    """Draws the normal force along the path, and the range in which the force counts as held.

    Args:
        scene: Scene after the episode.
        axes: Axes to draw in.
        share: Share of the path with the held force [%].
    """
    low, high = ((1.0 + side * TOLERANCE) * scene.force for side in (-1.0, 1.0))
    axes.axhspan(low, high, color=PALE, label=f"within 10 %:\n{share:.1f} % of the path")
    axes.axhline(scene.force, color=GREY, lw=1, ls="--", label=f"requested: {scene.force:.1f} N")
    if scene.stamps:
        axes.plot(ways_along(scene.stamps), scene.forces, color=BLUE, label=f"mean: {np.mean(scene.forces):.2f} N")
    axes.set(
        xlabel="distance along the path [m]", ylabel="normal force [N]", ylim=(0.8 * scene.force, 1.2 * scene.force)
    )
    axes.margins(x=0.01)
    legend_beside(axes)


def draw_board(scene: Wiping, axes: Axes, share: float) -> None:
    """Draws the wiped cells, the path of the sponge, and all stains. Stains that are not removed are filled.

    Args:
        scene: Scene after the episode.
        axes: Axes to draw in.
        share: Share of wiped cells [%].
    """
    depth, width = SIZE_M
    extent = (-width / 2.0, width / 2.0, -depth / 2.0, depth / 2.0)
    axes.imshow(scene.covered, origin="lower", extent=extent, cmap=ListedColormap(["white", WIPED]), vmin=0, vmax=1)
    if scene.stamps:
        x, y, _ = np.array(scene.stamps).T
        axes.plot(y, x, color=BLUE, lw=1)
    for name, (x, y) in scene.stains.items():
        axes.add_patch(Circle((y, x), STAIN_M, ec=STAIN, fc=STAIN if name in scene.left else "none"))
    gone = len(scene.stains) - len(scene.left)
    axes.set(
        title=f"wiped: {share:.1f} % of the area, {gone} of {len(scene.stains)} stains",
        xlabel="y on the board [m]",
        ylabel="x on the board [m]",
        xlim=(-0.62 * width, 0.62 * width),
        ylim=(-0.55 * depth, 0.55 * depth),
    )


def main() -> None:
    """Runs the episode with the seed `--seed`, and writes the picture `--out`."""
    parser = argparse.ArgumentParser(description="Wipes a board, and draws force and coverage.")
    parser.add_argument("--seed", type=int, default=1, help="seed of the episode, as in ./rpbi score wiping")
    parser.add_argument("--out", type=Path, default=Path("wiping.png"), help="the picture")
    chosen = parser.parse_args()
    env = make_env("wiping")
    result = run_episode(env, chosen.seed)
    draw(cast(Wiping, cast(SceneTask, env.task).scene), result, f"wiping, seed {chosen.seed}", chosen.out)
    env.close()


if __name__ == "__main__":
    main()
