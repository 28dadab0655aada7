"""The command `check_dataset`."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import printable
from rpbi_data.datasets.checks import source_faults
from rpbi_data.datasets.confinement import ERROR, FAULT, SUMMARY, CheckLine, confined, look_at
from rpbi_data.datasets.formats import format_of
from rpbi_data.datasets.provenance import is_exported
from rpbi_data.episodes.folder import EpisodeFolder

MAX_FAULTS = 1000
"""Number of reported faults after which the check ends."""


def check_dataset(
    folder: Annotated[Path, Argument("DIR", parse=Path)],
    *,
    source: Annotated[Path | None, Argument("DIR", parse=Path)] = None,
    formats: Annotated[Sequence[str], Argument("MODULE:CLASS ...")] = (),
    any_size: Annotated[bool, Argument("")] = False,
) -> int:
    """Checks a data set of LeRobot, robomimic or rosbag2, and prints a line for each fault.

    The exit code is 1 if there are faults; see docs/datasets.md. Data sets of other tools are checked, too, except for
    the comparison with exported values. No ROS master is needed. All formats except robomimic need `./rpbi setup data`
    first.

    Args:
        folder: the data set
        source: the folder of the exported episodes; checks that their recordings have not changed since the export
        formats: your own data set formats, which are tried in addition to the built-in formats
        any_size: lifts the limits of processor time and memory, which otherwise grow with the size of the data set
    """
    tree = look_at(folder) if folder.is_dir() else None
    if tree is not None and tree.faults:
        lines = iter([CheckLine(FAULT, fault) for fault in tree.faults[:MAX_FAULTS]])
    else:
        size = tree.size if tree is not None else 0
        lines = confined(partial(_check, folder, source, tuple(formats)), size, any_size)
    count = 0
    for kind, text in lines:
        safe = "\n".join(printable(each, len(each)) for each in text.splitlines())
        if kind == ERROR:
            raise InterfaceError(safe)
        print(safe, flush=True)
        count += kind == FAULT
    if count:
        print(f"{count} fault{'s' if count > 1 else ''}")
    return min(count, 1)


def _check(folder: Path, source: Path | None, others: tuple[str, ...]) -> Iterator[CheckLine]:
    try:
        found = format_of(folder, others)
        count = 0
        for faults in (found.faults(folder), source_faults(folder, EpisodeFolder(source)) if source else ()):
            for fault in faults:
                if count == MAX_FAULTS:
                    yield CheckLine(FAULT, f"more than {MAX_FAULTS:,} faults: the rest is not checked")
                    return
                yield CheckLine(FAULT, fault)
                count += 1
        if not count:
            made_here = (
                "" if is_exported(folder) else "; without rpbi/, values were not compared with those of an export"
            )
            yield CheckLine(SUMMARY, f"{found.summary(folder)}: no fault{made_here}")
    except InterfaceError as error:
        yield CheckLine(ERROR, str(error))
    except MemoryError:
        raise
    except Exception as error:  # the readers of damaged files fail in many ways
        yield CheckLine(ERROR, f"{folder}: cannot be checked: {type(error).__name__}: {' '.join(str(error).split())}")
