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
"""Largest number of characters in the line of an episode."""


def verify(
    folder: Annotated[Path, Argument("DIR", parse=Path)],
    *,
    jobs: Annotated[int, Argument("N", parse=int)] = 1,
    trust: Annotated[Sequence[str], Argument("PACKAGE ...")] = (),
    max_ticks: Annotated[int, Argument("N", parse=int)] = MAX_TICKS,
    max_cpu: Annotated[int, Argument("S", parse=int)] = MAX_CPU_S,
    any_size: Annotated[bool, Argument("")] = False,
) -> int:
    """Simulates recorded episodes again and compares their states, with the files that are stored with them.

    It prints a line an episode: the same, or the first tick that differs, and files that were changed. Files that have
        changed on the disk are noted. It ends with 1 unless all are the same; needs no ROS master.

    Args:
        folder: of the episodes
        jobs: episodes at once, each in a process of its own; 1 without it
        trust: Python packages that the episodes may import, for types of your own
        max_ticks: episodes of more ticks are refused; 20,000,000 without it, 5.5 hours at 1 kHz
        max_cpu: episodes that need more seconds of processor time are ended; 3,600 without it
        any_size: also bags that unfold to more than 1 GiB and 255 times their size
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
