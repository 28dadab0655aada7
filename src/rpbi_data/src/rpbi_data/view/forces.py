"""Converts recorded forces to arrows and to lines of plots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from rpbi_data.bags.plots import panels_of

from .frames import Frames
from .scene import Array, Arrows

MAX_AGE_S = 0.2
"""Age of a message above which its forces are not drawn [s]."""
FORCE = [f"wrench/force/{axis}" for axis in "xyz"]
FRAME = "header/frame_id"
_NOTHING = np.empty((0, 3))


def contact_arrows(topic: str, table: pd.DataFrame, times: Array) -> Arrows:
    """Returns the contact forces on a body. The forces at each time are taken from the newest message.

    Args:
        topic: Topic of the contacts.
        table: Table of the messages of the topic.
        times: ROS times of the arrows, shape (n,) [s].
    """
    points, forces = (_columns(table, "position"), _contact_forces(table)) if "position/x" in table else (None, None)
    arrows = Arrows(topic, True, [], [])
    for rows in _newest(table.index.to_numpy(), times):
        is_contact = np.zeros(0, bool) if forces is None else np.isfinite(forces[rows]).all(axis=1)
        arrows.points.append(_NOTHING if points is None else points[rows][is_contact])
        arrows.forces.append(_NOTHING if forces is None else forces[rows][is_contact])
    return arrows


def wrench_arrows(topic: str, table: pd.DataFrame, frames: Frames) -> Arrows | str:
    """Returns the forces of stamped wrenches, drawn at the origin of the wrench frame.

    If the forces cannot be drawn, returns a message with the reason.

    Args:
        topic: Topic of the wrenches.
        table: Table of the messages of the topic.
        frames: TF frames at the times of the scene.
    """
    names = list(table[FRAME].dropna().unique()) if FRAME in table else []
    if len(names) != 1:
        return f"{topic} has no arrow: expected one frame in its headers, got {', '.join(map(repr, names)) or 'none'}"
    poses = frames.poses(names[0])
    if poses is None:
        return f"{topic} has no arrow: its frame '{names[0]}' is not on TF"
    arrows = Arrows(topic, False, [], [])
    force = table[FORCE].to_numpy()
    for i, rows in enumerate(_newest(table.index.to_numpy(), frames.times)):
        newest = force[rows][-1:]
        arrows.points.append(poses.position[i : i + len(newest)])
        arrows.forces.append(poses.rotation[i].apply(newest) if len(newest) else _NOTHING)
    return arrows


def force_panels(tables: Mapping[str, pd.DataFrame], start_s: float) -> dict[str, Mapping[str, pd.Series]]:
    """Returns the lines of each plot of forces and torques over time, indexed by plot title.

    Args:
        tables: Tables of contacts and stamped wrenches, indexed by topic.
        start_s: ROS time at which the time of the plots is 0 [s].
    """
    found: dict[str, Mapping[str, pd.Series]] = {}
    for topic, table in tables.items():
        for _, panels in panels_of(table.set_index(table.index - start_s)):
            found |= {f"{topic}: {label}": lines for label, lines in panels.items() if lines}
    return found


def _contact_forces(table: pd.DataFrame) -> Array:
    """Returns the contact force in each row of a table, shape (n, 3) [N]; NaN in rows without contact."""
    return np.asarray(
        _columns(table, "normal") * table[["normal_force"]].to_numpy()
        + _columns(table, "friction_direction_1") * table[["friction_force_1"]].to_numpy()
        + _columns(table, "friction_direction_2") * table[["friction_force_2"]].to_numpy()
    )


def _columns(table: pd.DataFrame, vector: str) -> Array:
    return table[[f"{vector}/{axis}" for axis in "xyz"]].to_numpy(float)


def _newest(stamps: Array, times: Array) -> Iterator[slice]:
    """Yields, for each time, the rows of the newest message; empty if the message is older than `MAX_AGE_S`."""
    for time_s in times:
        end = int(np.searchsorted(stamps, time_s, side="right"))
        is_new = end > 0 and time_s - stamps[end - 1] <= MAX_AGE_S
        yield slice(int(np.searchsorted(stamps, stamps[end - 1])), end) if is_new else slice(0, 0)
