"""The command `export`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import yaml

from custom_ros_tools.console.argument import Argument, UsageError, number
from custom_ros_tools.foreign import printable
from rpbi_data.datasets.export import ExportOptions, export_folder
from rpbi_data.datasets.formats import FORMATS
from rpbi_data.datasets.signals import NEXT, PREVIOUS, RowOptions
from rpbi_data.episodes.folder import EpisodeFolder

POSE, DELTAS = "pose", "deltas"
WORDS = (NEXT, PREVIOUS, POSE, DELTAS)
"""Keywords of `--action`; other arguments are topics."""


def export(
    folder: Annotated[Path, Argument("DIR", parse=Path)],
    *,
    to: Annotated[str, Argument("FORMAT", choices=lambda: FORMATS, is_open=True)] = "lerobot",
    out: Annotated[Path | None, Argument("DIR", parse=Path)] = None,
    fps: Annotated[int, Argument("N", parse=int)] = 30,
    task: Annotated[str, Argument("TEXT")] = "",
    label: Annotated[Sequence[str], Argument("LABEL ...")] = (),
    state: Annotated[Sequence[str] | None, Argument("TOPIC ...")] = None,
    action: Annotated[Sequence[str], Argument("WORD|TOPIC ...")] = (),
    images: Annotated[Sequence[str] | None, Argument("[TOPIC ...]")] = None,
    features: Annotated[Sequence[str] | None, Argument("[NAME ...]")] = None,
    end_effector: Annotated[str, Argument("ROBOT/LINK")] = "",
    gripper: Annotated[Sequence[str], Argument("JOINT ...")] = (),
    max_time_error: Annotated[float, Argument("S", parse=number)] = math.inf,
    option: Annotated[Sequence[str], Argument("KEY=VALUE ...")] = (),
    disk_reserve_mb: Annotated[float, Argument("MB", parse=number)] = 200.0,
    any_size: Annotated[bool, Argument("")] = False,
) -> int:
    """Exports the episodes of a folder as a data set of another project.

        ./rpbi export ~/demos --to lerobot --out ~/push --task "push the box to the goal" --label success

    Episodes that cannot be exported are named, the others are exported, and the exit code is 1; see docs/datasets.md.
    It needs no ROS master, and `./rpbi setup data` for all formats except robomimic.

    Usage:
        ./rpbi export DIR [--to FORMAT] [--out DIR] [--fps N] [--task TEXT] [--label LABEL ...]
                      [--state TOPIC ...] [--action [next|previous] [pose] [deltas] [TOPIC ...]]
                      [--images [TOPIC ...]] [--features [NAME ...]] [--end-effector ROBOT/LINK]
                      [--gripper JOINT ...] [--max-time-error S]
                      [--option KEY=VALUE ...] [--disk-reserve-mb MB] [--any-size]

    Args:
        folder: of the episodes
        to: {choices}, or module:Class of a format of your own; lerobot without it
        out: the data set, a folder that does not exist; DIR_FORMAT without it
        fps: rows a second; 30 without it
        task: the task in words; the name of DIR without it
        label: only episodes with one of these labels
        state: topics of observation.state; the positions of all joints without it
        action: next, the newest command before the next row, as in LeRobot, is the default; previous: before the row;
            pose: that of the end effector at the next row, not commands; deltas: changes, not values;
            TOPIC ...: commands other than the targets of all joints
        images: topics of images; all cameras without it, none without a topic
        features: observations beside the state, such as velocity 'pose.*' contact_force.box; all without it
        end_effector: also observes the pose of this link, which has to be on TF
        gripper: joints that are an observation of their own, and come last in action
        max_time_error: episodes with an observation further from its row are left out
        option: options of the format, such as preset=slow
        disk_reserve_mb: free space of the disk that is never used; 200 without it
        any_size: also bags that unfold to more than 1 GiB and 255 times their size
    """
    if fps < 1:
        raise UsageError(f"--fps: expected at least 1, got {fps}")
    found = FORMATS.configured(to, "--to")
    made: Any = found
    words, topics = set(action) & {*WORDS}, tuple(each for each in action if each not in WORDS)
    if len(words & {NEXT, PREVIOUS}) == 2 or words >= {PREVIOUS, POSE}:
        raise UsageError(f"--action: expected next or previous, and pose only with next, got {' '.join(action)}")
    if POSE in words and not end_effector:
        raise UsageError("--action pose: expected --end-effector ROBOT/LINK, too")
    row_options = RowOptions(
        state=None if state is None else tuple(state),
        action=topics or None,
        images=None if images is None else tuple(images),
        features=None if features is None else tuple(features),
        end_effector=end_effector,
        gripper=tuple(gripper),
        timing=PREVIOUS if PREVIOUS in words else NEXT,
        is_pose=POSE in words,
        is_delta=DELTAS in words,
    )
    name = task or folder.absolute().name
    options = ExportOptions(fps, name, tuple(label), row_options, disk_reserve_mb, any_size, max_time_error)
    target = out or folder.absolute().with_name(f"{folder.absolute().name}_{to.rpartition(':')[2]}")
    format_ = made(made.Config.parse(_options(option), "--option"))
    result = export_folder(EpisodeFolder(folder), target, to, format_, options, lambda line: print(line, flush=True))
    for fault in result.faults:
        print(printable(fault))
    count = len(result.exported)
    print(f"{target} has {count} episode{'s' * (count != 1)}")
    return 1 if result.faults else 0


def _options(words: Sequence[str]) -> dict[str, Any]:
    """Parses arguments `KEY=VALUE`, in which values are YAML; returns the values, indexed by key."""
    found = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise UsageError(f"--option: expected KEY=VALUE, got {word}")
        try:
            found[key] = yaml.safe_load(value)
        except yaml.YAMLError:
            found[key] = value
    return found
