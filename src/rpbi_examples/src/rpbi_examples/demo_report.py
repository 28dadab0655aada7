"""Report of the demo's recording: rates, errors, pictures and a text summary."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
import pandas as pd  # noqa: E402

from custom_ros_tools.plot_style import BLUE, INK, ORANGE, X, Y, Z, legend_beside, plot_style  # noqa: E402

ENOUGH = 0.95
"""Share of the expected rate that a topic's measured rate must reach."""
MIN_SPAN_RAD = 0.2
"""Smallest height of a joint's plot [rad or m], so that the noise of a joint at rest is not magnified."""


def measured_rates(messages: Mapping[str, int], expected_hz: Mapping[str, float], duration_s: float) -> pd.DataFrame:
    """Compares measured and expected message rates of topics.

    Args:
        messages: Number of received messages, indexed by topic.
        expected_hz: Expected rate [Hz], indexed by topic.
        duration_s: ROS time in which the messages were received [s].

    Returns:
        One row for each topic with the columns `messages`, `rate_hz`, `expected_hz`, and `enough`: whether the measured
        rate reaches the share `ENOUGH` of the expected rate.
    """
    table = pd.DataFrame({"expected_hz": pd.Series(expected_hz, dtype=float)})
    table.index.name = "topic"
    table["messages"] = [messages.get(topic, 0) for topic in table.index]
    table["rate_hz"] = table["messages"] / duration_s
    # One message may fall outside either end.
    table["enough"] = (table["messages"] + 1) / duration_s >= ENOUGH * table["expected_hz"]
    return table[["messages", "rate_hz", "expected_hz", "enough"]]


def tracking_error(states: pd.DataFrame, targets: pd.DataFrame) -> pd.DataFrame:
    """Computes the differences between joint positions and the latest targets at each time of `states`.

    Args:
        states: Joint states with columns `position/JOINT`, indexed by time [s].
        targets: Joint targets with the same columns, indexed by time [s].

    Returns:
        One row for each joint with the columns `rms` and `max` (largest absolute difference) [rad or m].
    """
    columns = [column for column in targets.columns if column.startswith("position/")]
    latest = targets[columns].ffill()
    held = latest[~latest.index.duplicated(keep="last")].reindex(states.index, method="ffill")
    error = (states[columns] - held).dropna()
    error.columns = [column.removeprefix("position/") for column in columns]
    return pd.DataFrame({"rms": np.sqrt((error**2).mean()), "max": error.abs().max()})


@plot_style()
def plot_joints(states: pd.DataFrame, targets: pd.DataFrame, path: Path) -> None:
    """Writes a picture of positions and targets over time, for all joints that have targets."""
    columns = [column for column in targets.columns if column.startswith("position/")]
    start_s = states.index[0]
    size = (9, 1.3 * len(columns) + 1)
    figure, axes = plt.subplots(len(columns), sharex=True, figsize=size, squeeze=False, layout="constrained")
    for axis, column in zip(axes[:, 0], columns, strict=True):
        axis.plot(targets.index - start_s, targets[column], color=ORANGE, lw=2.2, label="target")
        axis.plot(states.index - start_s, states[column], color=INK, lw=1.0, label="position")
        axis.set_ylabel(column.removeprefix("position/").removesuffix("_joint") + "\n[rad]", fontsize=9)
        low, high = axis.get_ylim()
        half = max((high - low) / 2.0, MIN_SPAN_RAD / 2.0)
        axis.set_ylim((low + high) / 2.0 - half, (low + high) / 2.0 + half)
    axes[-1, 0].set_xlabel("simulated time [s]")
    axes[-1, 0].legend(loc="upper center", bbox_to_anchor=(0.5, -0.5), ncols=2)
    _save(figure, path, "Joint positions and their targets")


@plot_style()
def plot_efforts(states: pd.DataFrame, joints: list[str], path: Path) -> None:
    """Writes a picture of the motor efforts of the given joints over time."""
    figure, axis = plt.subplots(figsize=(9, 4), layout="constrained")
    for joint in joints:
        axis.plot(states.index - states.index[0], states[f"effort/{joint}"], lw=1.0, label=joint)
    axis.set_xlabel("simulated time [s]")
    axis.set_ylabel("effort [N m]")
    legend_beside(axis)
    _save(figure, path, "Motor efforts")


def contact_force(contacts: pd.DataFrame, other_body: str) -> pd.Series:
    """Returns the sum of the normal forces between a body and another body [N], indexed by time [s].

    Args:
        contacts: Contacts of a body, indexed by time [s]. Each contact is a row with the columns `other_body` and
            `normal_force`. A time without contact also has a row; the sum is then 0.
        other_body: Name of the other body.
    """
    if "other_body" not in contacts:  # no contact in the whole recording
        return pd.Series(0.0, contacts.index)
    forces = contacts["normal_force"].where(contacts["other_body"] == other_body)
    return forces.groupby(level=0).sum()


def force_figures(push: pd.Series) -> dict[str, float]:
    """Returns the mean pushing force during contact and the largest pushing force [N]. Without contact, both are 0."""
    touching = push[push > 0.0]
    if touching.empty:
        return {"push_mean_n": 0.0, "push_max_n": 0.0}
    return {"push_mean_n": round(float(touching.mean()), 2), "push_max_n": round(float(touching.max()), 2)}


@plot_style()
def plot_forces(push: pd.Series, friction: pd.Series, wrist: pd.DataFrame, start_s: float, path: Path) -> None:
    """Writes a picture with the push on the box, the floor's friction limit, and the force in the wrist over time [N].

    Args:
        push: Force of the arm on the box [N], indexed by time [s].
        friction: Largest possible friction force of the floor [N]: the coefficient times the normal force, indexed by
            time [s].
        wrist: Samples of the force-torque sensor, indexed by time [s].
        start_s: Time at the origin of the plot [s].
        path: Picture file to write.
    """
    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(10, 5.4), layout="constrained")
    above.plot(friction.index - start_s, friction, color=INK, lw=3.0, alpha=0.35, label="friction limit \u03bc N")
    above.plot(push.index - start_s, push, color=BLUE, lw=1.4, label="arm on the box")
    above.set_ylabel("force on the box [N]")
    for axis, colour in zip("xyz", (X, Y, Z)):
        below.plot(wrist.index - start_s, wrist[f"wrench/force/{axis}"], color=colour, lw=1.4, label=axis)
    below.set_ylabel("force in the wrist [N]")
    below.set_xlabel("simulated time [s]")
    for part in (above, below):
        for begin_s, end_s in _contact_times(push):
            part.axvspan(begin_s - start_s, end_s - start_s, color=BLUE, alpha=0.1, lw=0, label="arm pushes")
        handles = dict(zip(*reversed(part.get_legend_handles_labels())))  # one entry for all pushes
        part.legend(handles.values(), handles, loc="center left", bbox_to_anchor=(1.01, 0.5))
    _save(figure, path, "Push of the arm on the box, and force-torque sensor in the wrist")


def _contact_times(push: pd.Series) -> list[tuple[float, float]]:
    """Returns the first and the last time of each contact without a gap [s]."""
    touches = push > 0.0
    contacts = touches.index.to_series().groupby((touches != touches.shift()).cumsum()[touches])
    return [(float(times_s.iloc[0]), float(times_s.iloc[-1])) for _, times_s in contacts]


def save_colour(pixels: npt.NDArray[np.uint8], path: Path) -> None:
    """Writes a colour image of shape (height, width, 3) to a picture file."""
    plt.imsave(path, pixels)


@plot_style()
def save_depth(depth_m: npt.NDArray[np.float32], far_m: float, path: Path) -> None:
    """Writes a picture of a depth image.

    Args:
        depth_m: Depth of each pixel, shape (height, width) [m].
        far_m: Depth of the far plane [m]; pixels at this depth are white.
        path: Picture file to write.
    """
    figure, axis = plt.subplots(figsize=(7.2, 4.9), layout="constrained")
    image = axis.imshow(np.where(depth_m < 0.999 * far_m, depth_m, np.nan), cmap="viridis_r")
    figure.colorbar(image, ax=axis, label="depth along the optical axis [m]")
    axis.set_xlabel("column [px]")
    axis.set_ylabel("row [px]")
    _save(figure, path, "Depth image")


def failures(summary: Mapping[str, Any], required: Collection[str]) -> list[str]:
    """Returns a line of text for each required topic without messages."""
    topics = summary["topics"].items()
    return [f"{topic} had no message" for topic, row in topics if topic in required and not row["messages"]]


def slow_lines(summary: Mapping[str, Any], images: Collection[str], world: str) -> list[str]:
    """Returns lines of text with cause and remedy for rates that are too low.

    Args:
        summary: The summary of the recording.
        images: Topics of the camera, which share one line.
        world: The world's main YAML file, which the remedy names.
    """
    topics, factor = summary["topics"], summary["figures"]["real_time_factor"]
    lines = [] if factor >= ENOUGH else [f"physics ran at {factor:.0%} of real time, {_load(summary)}"]
    slow_images = _too_few(summary, images)
    if slow_images:
        slowest = min((topics[topic] for topic in slow_images), key=lambda row: row["rate_hz"])
        lines.append(
            f"images came at {_rate(slowest)}: {_load(summary)}, drawing alone reaches "
            f"{summary['figures']['draw_rate_hz']:.1f} Hz, and cameras give way to all other programs. "
            f"End other programs, or lower hz, width or height of rgbd_sensor in {world}"
        )
    others = _too_few(summary, topics.keys() - set(images))
    if others:
        rates = ", ".join(f"{topic} came at {_rate(topics[topic])}" for topic in others)
        lines.append(f"{rates}: {_load(summary)}, publishers wait for a processor. End other programs")
    return lines


def _too_few(summary: Mapping[str, Any], wanted: Collection[str]) -> list[str]:
    return [topic for topic, row in summary["topics"].items() if topic in wanted and not row["enough"]]


def _rate(row: Mapping[str, Any]) -> str:
    return f"{row['rate_hz']:.1f} instead of {row['expected_hz']:g} Hz"


def _load(summary: Mapping[str, Any]) -> str:
    figures = summary["figures"]
    return f"with a load of {figures['load_average']:.1f} on {figures['cores']} cores"


def as_text(summary: Mapping[str, Any]) -> str:
    """Formats the summary as a table for the terminal."""
    lines = [f"{'topic':<36}{'messages':>9}{'rate [Hz]':>11}{'expected':>10}"]
    for topic, row in summary["topics"].items():
        mark = "" if row["enough"] else "  TOO FEW"
        lines.append(f"{topic:<36}{row['messages']:>9}{row['rate_hz']:>11.2f}{row['expected_hz']:>10.1f}{mark}")
    lines += [""] + [f"{key:<36}{value}" for key, value in summary["figures"].items()]
    return "\n".join(lines)


def _save(figure: Any, path: Path, title: str) -> None:
    figure.suptitle(title, fontsize=12, x=0.01, ha="left")
    figure.savefig(path)
    plt.close(figure)
