"""Draws docs/images/primitives.png: a DMP and a ProMP.

.venv/bin/python dev/tools/primitives/figure.py docs/images/primitives.png
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from custom_ros_tools.plot_style import BLUE, GREEN, GREY, INK, ORANGE, plot_style
from motion_primitives import Demonstration, ObstacleCoupling, ViaPoint, make_primitive

TIMES = np.linspace(0.0, 4.0, 401)
SHARE = np.sin(np.linspace(0.0, np.pi / 2, 401)) ** 2
SHOWN = np.stack([0.5 * SHARE, 0.12 * np.sin(np.pi * SHARE) + 0.1 * SHARE, 0.0 * SHARE], axis=1)


def draw_dmp(axes):
    primitive = make_primitive("dmp", {}).learn(Demonstration.of(TIMES, SHOWN))
    axes.plot(*SHOWN.T[:2], "--", color=INK, label="demonstration")
    for x, y in ((0.55, -0.1), (0.6, 0.05), (0.55, 0.25)):
        axes.plot(*primitive.plan(goal=[x, y, 0.0]).positions.T[:2], color=BLUE, lw=1.2)
        axes.plot(x, y, "o", color=BLUE)
    axes.plot([], [], "o-", color=BLUE, lw=1.2, label="plans to other goals")
    motion, path = primitive.begin(), []
    while not motion.is_at_goal():
        if len(path) == 180:
            motion.set_goal([0.35, -0.1, 0.0])
        path.append(motion.step(0.01).point)
    axes.plot(*np.array(path).T[:2], color=ORANGE, label="plan whose goal is changed half-way")
    axes.plot(0.35, -0.1, "o", color=ORANGE)
    ball = ObstacleCoupling([0.22, 0.155, 0.0], 0.04)
    axes.add_patch(plt.Circle(ball.center[:2], ball.radius_m, color=GREY, alpha=0.5, lw=0, label="obstacle"))
    axes.plot(*primitive.plan(couplings=[ball]).positions.T[:2], color=GREEN, label="plan around an obstacle")
    axes.set(title="dmp: learned from one demonstration", xlabel="x [m]", ylabel="y [m]", aspect="equal")


def draw_promp(axes):
    rng = np.random.default_rng(1)
    shown = []
    for _ in range(6):
        bump, end = rng.normal(0.0, 0.02, 2)
        shown.append(SHOWN + np.outer(np.sin(np.pi * SHARE), [0, bump, 0]) + np.outer(SHARE, [0, end, 0]))
    primitive = make_primitive("promp", {"prior": 0.1}).learn([Demonstration.of(TIMES, each) for each in shown])
    for each in shown:
        axes.plot(TIMES, each[:, 1], color=INK, lw=0.7)
    axes.plot([], [], color=INK, lw=0.7, label="demonstrations")
    via = [ViaPoint(0.5, [0.25, 0.22, 0.0])]
    progress = np.linspace(0.0, 1.0, 101)
    for color, label, distribution in (
        (BLUE, "learned motions: mean and two standard deviations", primitive.distribution),
        (ORANGE, "the same through a via-point", primitive.conditioned(via)),
    ):
        mean = np.array([primitive.mean_at(distribution, u)[0][1] for u in progress])
        std = primitive.stds(progress, distribution)[:, 1]
        axes.fill_between(4.0 * progress, mean - 2 * std, mean + 2 * std, color=color, alpha=0.25, lw=0)
        axes.plot(4.0 * progress, mean, color=color, label=label)
    axes.plot(2.0, 0.22, "o", color=INK, zorder=3, label="via-point")
    axes.set(title="promp: learned from six demonstrations", xlabel="time [s]", ylabel="y [m]")


@plot_style()
def main(path):
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5.4), layout="constrained")
    draw_dmp(left)
    draw_promp(right)
    for axes, x in ((left, 0.05), (right, 0.55)):
        axes.figure.legend(*axes.get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(x, 0.265))
    figure.get_layout_engine().set(rect=(0.0, 0.27, 1.0, 0.73), wspace=0.06)
    figure.savefig(path)


if __name__ == "__main__":
    main(sys.argv[1])
