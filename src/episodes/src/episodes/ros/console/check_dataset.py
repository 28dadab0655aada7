"""The command `check_dataset`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument
from episodes.datasets.checks.values import source_faults
from episodes.datasets.formats import format_of
from episodes.datasets.provenance import is_exported
from episodes.folder import EpisodeFolder


def check_dataset(
    folder: Annotated[Path, Argument("DIR", parse=Path)],
    *,
    source: Annotated[Path | None, Argument("DIR", parse=Path)] = None,
    formats: Annotated[Sequence[str], Argument("MODULE:CLASS ...")] = (),
) -> int:
    """Checks a data set of LeRobot, robomimic or rosbag2, and names its faults.

    It prints a line a fault and ends with 1 if there is one; see docs/datasets.md. Data sets of other tools are checked
    too, except against the values of an export. It needs no ROS master, and `./rpbi setup data` for all formats except
    robomimic.

    Args:
        folder: the data set
        source: the folder of the episodes, to compare their recordings
        formats: formats of your own
    """
    found = format_of(folder, tuple(formats))
    count = 0
    for fault in (*found.faults(folder), *(source_faults(folder, EpisodeFolder(source)) if source else ())):
        print(fault, flush=True)
        count += 1
    if count:
        print(f"{count} fault{'s' if count > 1 else ''}")
        return 1
    made_here = "" if is_exported(folder) else "; without rpbi/, values were not compared with those of an export"
    print(f"{found.summary(folder)}: no fault{made_here}")
    return 0
