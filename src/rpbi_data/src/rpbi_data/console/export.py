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
    """Exports the episodes of a folder as a data set for another project, such as LeRobot.

        ./rpbi export ~/demos --to lerobot --out ~/push --task "push the box to the goal" --label success

    Episodes that cannot be exported are skipped with a message, and the exit code is then 1; see docs/datasets.md.
    No ROS master is needed. All formats except robomimic need `./rpbi setup data` first.

    Usage:
        ./rpbi export DIR [--to FORMAT] [--out DIR] [--fps N] [--task TEXT] [--label LABEL ...]
                      [--state TOPIC ...] [--action [next|previous] [pose] [deltas] [TOPIC ...]]
                      [--images [TOPIC ...]] [--features [NAME ...]] [--end-effector ROBOT/LINK]
                      [--gripper JOINT ...] [--max-time-error S]
                      [--option KEY=VALUE ...] [--disk-reserve-mb MB] [--any-size]

    Args:
        folder: the folder of the episodes
        to: format: {choices}, or module:Class of your own; default: lerobot
        out: a new folder for the data set; default: DIR_FORMAT
        fps: rows per second; default: 30
        task: description of the task in words; default: the name of DIR
        label: exports only episodes with one of these labels
        state: topics of observation.state; default: the positions of all joints
        action: next: the action of a row is the newest command before the next row, as in LeRobot; this is the default;
            previous: the newest command at the row itself;
            pose: the end effector's pose at the next row instead of a command;
            deltas: changes from the values measured at the row;
            TOPIC ...: topics of commands; default: the targets of all joints
        images: topics of images; default: all cameras; `--images` without a topic exports no images
        features: observations in addition to the state, such as velocity 'pose.*' contact_force.box; default: all
        end_effector: adds the pose of this link, which must be on TF, to the observations
        gripper: joints of the gripper, which become a separate observation and the last numbers of the action
        max_time_error: skips episodes in which a row is more than S seconds from the nearest message of an observation
        option: options of the format, such as preset=slow
        disk_reserve_mb: free disk space below which no further episode is exported [MB]; default: 200
        any_size: also exports bags whose unpacked size exceeds both 1 GiB and 255 times their file size
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
    """Parses words of the form `KEY=VALUE`, in which VALUE is YAML, and returns the values, indexed by key."""
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
