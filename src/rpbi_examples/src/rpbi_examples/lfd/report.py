"""Results of a session: final errors of the box, summary.json, and pictures of demonstration, plan and execution."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from custom_ros_tools.files import atomic_file
from custom_ros_tools.plot_style import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, SKY, plot_style
from custom_ros_tools.transforms import Array
from rpbi_examples.motions import PlanarPose

from .person import HALF_SIDE_M
from .skill import PushPlan, ShownPush

NEAR_M, NEAR_RAD = 0.03, math.radians(10.0)
"""Largest distance [m] and angle [rad] from the goal at which the box counts as at its goal."""
SHOWN_SHARE = 2.0 / 3.0
"""A demonstration counts as good within this share of `NEAR_M` and `NEAR_RAD`, since an execution adds errors."""
TIP, BOX, GOAL = BLUE, ORANGE, GREEN
SHOWN_STYLE = {"color": TIP, "linestyle": "--", "linewidth": 1.5}
KEYS = ("signal/x", "signal/y")
SIZES = {"paths": (11.0, 6.0), "pipeline": (9.6, 12.0)}
"""Widths and heights of the figures [in], by the names of their files."""
BESIDE = 0.025
"""Width of the labels next to a plot, as a share of the figure."""


class BoxError(NamedTuple):
    """Distance [m] and angle [rad] of a box from its goal."""

    distance_m: float
    angle_rad: float

    @classmethod
    def of(cls, position: Array, quat_xyzw: Array) -> BoxError:
        """Computes the error of a box from the box's pose in the goal's frame.

        Args:
            position: x, y, z [m].
            quat_xyzw: Orientation. The error is the whole rotation angle, so a tipped box has a large error.
        """
        return cls(float(np.linalg.norm(position)), 2.0 * math.acos(min(abs(float(quat_xyzw[3])), 1.0)))

    @property
    def is_at_goal(self) -> bool:
        """Whether the error is small enough for the box to be at its goal."""
        return self._is_within(1.0)

    @property
    def is_good_to_learn(self) -> bool:
        """Whether a demonstration with this final error is good enough to learn from."""
        return self._is_within(SHOWN_SHARE)

    def _is_within(self, share: float) -> bool:
        return self.distance_m <= share * NEAR_M and self.angle_rad <= share * NEAR_RAD

    def __str__(self) -> str:
        return f"{1000.0 * self.distance_m:.1f} mm and {math.degrees(self.angle_rad):.1f} deg from its goal"


class Run(NamedTuple):
    """A recorded demonstration, or the recorded execution of a plan. Positions are in the person's frame.

    Attributes:
        episode: Number of the recorded episode.
        table: Samples indexed by time [s], with the columns tip/x, tip/y, box/x, box/y [m], box/yaw [rad], contact [N],
            signal/x, signal/y [m/s].
        error: Distance and angle of the box from its goal at the end.
        plan: The executed plan. None for a demonstration.
    """

    episode: int
    table: pd.DataFrame
    error: BoxError
    plan: PushPlan | None = None

    def path(self) -> ShownPush:
        """Returns the tip's path, with the time of the first contact with the box."""
        touched = self.table.index[self.table["contact"] > 0.0]
        contact_s = float(touched[0]) if len(touched) else None
        return ShownPush(self.table.index.to_numpy(), self.table[["tip/x", "tip/y"]].to_numpy(), contact_s)

    def summary(self) -> dict[str, Any]:
        """Returns the entry for this run in summary.json."""
        return {
            "episode": self.episode,
            "seconds": round(float(self.table.index[-1] - self.table.index[0]), 2),
            "start": [round(float(self.table[f"tip/{axis}"].iloc[0]), 4) for axis in "xy"],
            "box_error_m": round(self.error.distance_m, 4),
            "box_error_deg": round(math.degrees(self.error.angle_rad), 2),
            "at_goal": self.error.is_at_goal,
        }


def write_summary(path: Path, facts: dict[str, Any], shown: Sequence[Run], executed: Sequence[Run]) -> None:
    """Writes summary.json.

    Args:
        path: File to write.
        facts: Entries about the whole session.
        shown: Demonstrations.
        executed: Executions.
    """
    text = {
        **facts,
        "demonstrations": [run.summary() for run in shown],
        "executions": [run.summary() for run in executed],
        "at_goal": bool(executed) and all(run.error.is_at_goal for run in executed),
    }
    with atomic_file(path) as part:
        part.write_text(json.dumps(text, indent=2) + "\n")


def write_tables(table: pd.DataFrame, path: Path) -> None:
    """Writes a table to two files, with the suffixes `.parquet` and `.csv`.

    Raises:
        OSError: If a file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path.with_suffix(".parquet")) as part:
        table.to_parquet(part, engine="fastparquet")
    with atomic_file(path.with_suffix(".csv")) as part:
        table.to_csv(part, float_format="%.6g")


@plot_style()
def write_picture(figure: Figure, path: Path) -> None:
    """Writes a figure to a picture file.

    Raises:
        OSError: If the file cannot be written.
    """
    with atomic_file(path) as part:
        figure.savefig(part)


@plot_style()
def draw_paths(figure: Figure, goal: PlanarPose, shown: Run, executed: Sequence[Run]) -> None:
    """Draws a demonstration and all executions as seen from above. Only the last execution is drawn in detail."""
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _draw_run(left, goal, shown, f"demonstration: box {shown.error}")
    for run in executed[:-1]:
        right.plot(run.table["tip/x"], run.table["tip/y"], color=PALE, linewidth=1.0)
    right.plot(shown.table["tip/x"], shown.table["tip/y"], label="demonstration", **SHOWN_STYLE)
    _draw_run(right, goal, executed[-1], f"execution {len(executed)}: box {executed[-1].error}")


@plot_style()
def draw_pipeline(figure: Figure, goal: PlanarPose, shown: Run, executed: Run) -> None:
    """Draws six plots, from the operator's signal to the executed plan, and connects the plots with arrows."""
    assert executed.plan is not None
    plan, seconds = executed.plan, shown.table.index - shown.table.index[0]
    grid = figure.subplots(3, 2)
    (signal, where), (learned, states), (planned, execution) = grid
    for key, colour in zip(KEYS, (TIP, GOAL)):
        signal.plot(seconds, shown.table[key], color=colour, label=f"{key[-1]}", drawstyle="steps-post")
    signal.set(title="1  operator: signal h", xlabel="time [s]", ylabel="velocity [m/s]")
    _draw_run(where, goal, shown, "2  demonstration: tip u and box x")
    for key, colour in (("tip/x", TIP), ("tip/y", GOAL), ("box/x", BOX), ("box/y", PURPLE)):
        states.plot(seconds, shown.table[key], color=colour, label=key)
    states.set(title=f"3  rosbag to DataFrame: {len(shown.table)} rows", xlabel="time [s]", ylabel="[m]")
    moved_s = plan.times - plan.push_s + _push_begins(shown, plan)
    for axis, colour in zip("xy", (TIP, GOAL)):
        learned.plot(
            seconds, shown.table[f"tip/{axis}"], color=colour, alpha=0.35, linewidth=4.0, label=f"shown {axis}"
        )
        learned.plot(moved_s, plan.places[:, "xy".index(axis)], color=colour, label=f"DMP {axis}")
    learned.axvline(moved_s[0] + plan.push_s, color=GREY, linewidth=1.0, linestyle=":")
    learned.set(title="4  learned: approach | push", xlabel="time [s]", ylabel="[m]")
    planned.plot(shown.table["tip/x"], shown.table["tip/y"], label="demonstration", **SHOWN_STYLE)
    _draw_plan(planned, plan)
    _map(planned, goal, "5  plan from a random start")
    _draw_run(execution, goal, executed, "6  executed", with_plan=False)
    for axes in grid.flat:
        axes.legend(fontsize=9, loc="upper left", bbox_to_anchor=(-0.05, -0.16), ncols=2)
    figure.get_layout_engine().set(w_pad=0.3, h_pad=0.15)
    figure.draw_without_rendering()
    for begin, end in ((signal, where), (where, states), (states, learned), (learned, planned), (planned, execution)):
        _arrow(figure, begin, end)


def _push_begins(shown: Run, plan: PushPlan) -> float:
    """Returns the time [s] in the demonstration at which the tip was nearest to the start of the plan's push."""
    place, _ = plan.at(plan.push_s)
    tip = shown.table[["tip/x", "tip/y"]].to_numpy()
    return float((shown.table.index - shown.table.index[0])[int(np.argmin(np.linalg.norm(tip - place, axis=1)))])


def _draw_run(axes: Axes, goal: PlanarPose, run: Run, title: str, with_plan: bool = True) -> None:
    table = run.table
    boxes = [PlanarPose(*row) for row in table[["box/x", "box/y", "box/yaw"]].dropna().to_numpy()]
    for pose, style in ((boxes[0], ":"), (boxes[-1], "-")):
        axes.plot(*_outline(pose).T, color=BOX, linestyle=style, label="box at start" if style == ":" else "box at end")
    axes.plot([box.x for box in boxes], [box.y for box in boxes], color=BOX, linewidth=0.8)
    if run.plan is not None and with_plan:
        _draw_plan(axes, run.plan)
    axes.plot(table["tip/x"], table["tip/y"], color=TIP if run.plan is None else PURPLE, linewidth=1.4, label="tip")
    axes.plot(table["tip/x"].iloc[:1], table["tip/y"].iloc[:1], "o", color=INK, markersize=5, label="start")
    _map(axes, goal, title)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)


def _draw_plan(axes: Axes, plan: PushPlan) -> None:
    is_push = plan.times >= plan.push_s
    axes.plot(*plan.places[~is_push].T, color=SKY, linewidth=2.8, label="planned approach")
    axes.plot(*plan.places[is_push].T, color=GREY, linewidth=2.8, label="planned push")


def _map(axes: Axes, goal: PlanarPose, title: str) -> None:
    axes.fill(*_outline(goal).T, color=GOAL, alpha=0.2, label="goal")
    axes.set(xlabel="x, to the right [m]", ylabel="y, away from the person [m]", aspect="equal")
    axes.set_title(title, fontsize=10)


def _outline(box: PlanarPose) -> Array:
    """Returns the corners of the box at a pose, shape (5, 2) [m]. The last corner equals the first."""
    corners = HALF_SIDE_M * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)])
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + (box.x, box.y))


def _arrow(figure: Figure, begin: Axes, end: Axes) -> None:
    """Draws an arrow from one plot to a neighbouring plot. Both plots must already be at their final positions."""
    one, other = begin.get_position(), end.get_position()
    x, y = max(one.x1, other.x1) - BESIDE, (one.y0 + one.y1) / 2.0
    if abs(one.y0 - other.y0) > 0.1:
        tail, head = (x, one.y0 - 1.5 * BESIDE), (x, other.y1 + BESIDE)
    elif one.x0 < other.x0:
        tail, head = (one.x1 + BESIDE / 4.0, y), (other.x0 - 2.0 * BESIDE, y)
    else:
        tail, head = (one.x0 - 2.6 * BESIDE, y), (other.x1 + BESIDE / 4.0, y)
    arrow = FancyArrowPatch(
        tail, head, transform=figure.transFigure, arrowstyle="simple", mutation_scale=22, color=GREY
    )
    figure.add_artist(arrow)
