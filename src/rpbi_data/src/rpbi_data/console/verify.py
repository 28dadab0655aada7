"""The command `verify`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument, UsageError
from custom_ros_tools.foreign import printable
from rpbi_data.episodes.folder import EpisodeFolder
from rpbi_data.episodes.session_messages import MAX_TICKS
from rpbi_data.episodes.verified_messages import MAX_CPU_S, ReplayLimits, verify_all

MAX_LINE = 10_000
"""Largest number of characters that are printed for an episode."""


def verify(
    folder: Annotated[Path, Argument("DIR", parse=Path)],
    *,
    jobs: Annotated[int, Argument("N", parse=int)] = 1,
    trust: Annotated[Sequence[str], Argument("PACKAGE ...")] = (),
    max_ticks: Annotated[int, Argument("N", parse=int)] = MAX_TICKS,
    max_cpu: Annotated[int, Argument("S", parse=int)] = MAX_CPU_S,
    any_size: Annotated[bool, Argument("")] = False,
) -> int:
    """Simulates episodes again with their stored files, and compares states and messages with the recordings.

    Prints a line for each episode: whether the simulation equals the recording, the first tick that differs, and stored
    files that were changed. Notes list original files that were changed after the recording. The exit code is 0 only if
    all episodes equal their recordings. No ROS master is needed.

    Args:
        folder: the folder of the episodes
        jobs: number of processes, each of which simulates one episode at a time; default: 1
        trust: Python packages from which classes named in episodes may be imported, such as object types
        max_ticks: refuses episodes of more than N ticks; default: 20,000,000, which is 5.5 hours at 1 kHz
        max_cpu: stops simulating an episode after this processor time [s]; default: 3,600
        any_size: also reads bags whose unpacked size exceeds both 1 GiB and 255 times their file size
    """
    for flag, value in (("--jobs", jobs), ("--max-cpu", max_cpu)):
        if value < 1:
            raise UsageError(f"{flag}: expected at least 1, got {value}")
    episodes = EpisodeFolder(folder)
    numbers = episodes.numbers()
    same = 0
    for verdict in verify_all(episodes, numbers, jobs, trust, ReplayLimits(max_ticks, any_size, max_cpu)):
        label = f" ({verdict.label})" if verdict.label else ""
        line = "; ".join([f"episode {verdict.number}{label}: {verdict.text}", *verdict.notes])
        print(printable(line, MAX_LINE), flush=True)
        same += verdict.is_same
    print(f"{same} of {len(numbers)} episodes are the same")
    return 0 if numbers and same == len(numbers) else 1
