"""Records demonstrations and executions as episodes, and reads episodes as tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from cob_srvs.srv import SetString
from std_srvs.srv import Trigger

from custom_ros_tools.ros.services import call_service
from custom_ros_tools.transforms import yaw_of
from rpbi_data import EpisodeFolder, bag_to_dataframes, transforms_between
from rpbi_data.episodes.folder import BAG

from .arm_topics import ORIGIN, TIP
from .box_services import FRAME, NAME
from .report import BoxError, Run, write_tables
from .skill import PushPlan

CONTACTS, SIGNAL = f"/rpbi/{NAME}/contacts", "/operator_node/signal"
ROBOT = "kuka_lwr"


def begin_episode() -> str:
    """Starts the recording of an episode, and returns the recorder's message.

    Raises:
        InterfaceError: If the recorder cannot begin, for instance on a full disk.
    """
    return str(call_service("record/start", Trigger).message)


def discard_episode() -> str:
    """Discards the episode that is being recorded, and returns the recorder's message."""
    return str(call_service("record/discard", Trigger).message)


def finish_episode(out: Path, error: BoxError, plan: PushPlan | None = None) -> Run:
    """Stops the recording, labels the episode as success or failure, and writes the episode's table.

    Args:
        out: Folder of the results. Tables are written below `out/tables`.
        error: Distance and angle of the box from its goal at the end.
        plan: The executed plan. None for a demonstration.

    Raises:
        InterfaceError: If the recording cannot be stopped, or the episode cannot be read.
    """
    call_service("record/stop", Trigger)
    call_service("record/label", SetString, "success" if error.is_at_goal else "failure")
    folder = EpisodeFolder(out / "episodes")
    number = max(folder.numbers())
    table = read_episode(folder.folder_of(number) / BAG)
    write_tables(table, out / "tables" / f"episode_{number:06d}")
    return Run(number, table, error, plan)


def read_episode(bag: str | Path) -> pd.DataFrame:
    """Reads an episode's bag, and returns one table with the columns of `Run.table`.

    The table has a row for each recorded pose of the tip. All other columns hold the values nearest to the row's time.

    Raises:
        InterfaceError: If the bag cannot be read, or lacks the frame of the tip or of the box.
    """
    tables = bag_to_dataframes(bag)
    tip, box = (transforms_between(tables, ORIGIN, frame) for frame in (TIP, FRAME))
    yaw = [yaw_of(quat) for quat in box[[f"rotation/{each}" for each in "xyzw"]].to_numpy()]
    parts = [_named(box, "box").assign(**{"box/yaw": np.unwrap(yaw)})]
    if CONTACTS in tables:
        contacts = tables[CONTACTS]
        force = contacts["normal_force"].where(contacts["other_body"] == ROBOT, 0.0).groupby(level=0).max()
        parts.append(force.rename("contact").to_frame())
    if SIGNAL in tables:
        parts.append(tables[SIGNAL][["data/0", "data/1"]].set_axis(["signal/x", "signal/y"], axis=1))
    table = _named(tip, "tip")
    for part in parts:
        table = pd.merge_asof(table, part, left_index=True, right_index=True, direction="nearest")
    return table.reindex(columns=[*table.columns, *({"contact", "signal/x", "signal/y"} - {*table.columns})]).fillna(
        0.0
    )


def _named(poses: pd.DataFrame, name: str) -> pd.DataFrame:
    return poses[["translation/x", "translation/y"]].set_axis([f"{name}/x", f"{name}/y"], axis=1)
