"""The command `farm`."""

import os
import sys
from collections import Counter
from pathlib import Path
from typing import Annotated

from tqdm import tqdm

from custom_ros_tools.console.argument import Argument, UsageError, number
from custom_ros_tools.foreign import printable
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.folder import EpisodeFolder
from rpbi_data.farm.ros.farm import Farm


def farm(
    world: Annotated[str, Argument("WORLD.yaml", files="*.yaml")],
    *,
    policy: Annotated[str, Argument("MODULE:CLASS")],
    episodes: Annotated[int, Argument("N", parse=int)],
    out: Annotated[Path, Argument("DIR", parse=Path)] = Path("farm"),
    seed: Annotated[int, Argument("N", parse=int)] = 0,
    seconds: Annotated[float, Argument("S", parse=number, excludes="length")] = 10.0,
    ticks: Annotated[int, Argument("N", parse=int, excludes="length")] = 0,
    images: Annotated[bool, Argument("")] = False,
    jobs: Annotated[int | None, Argument("N", parse=int)] = None,
    address: Annotated[str | None, Argument("HOST:PORT")] = None,
    disk_reserve_mb: Annotated[float, Argument("MB", parse=number)] = 200.0,
) -> int:
    """Makes episodes in which a policy acts in a simulated world; several episodes are made at the same time.

        ./rpbi farm WORLD.yaml --policy push:Push --episodes 200 --out pushes

    No ROS master is needed. Existing episodes are not made again, so the same command continues after an interruption.
    Episodes that cannot be made are skipped with a message, and the exit code is then 1; see docs/farm.md.

    Usage:
        ./rpbi farm WORLD.yaml --policy MODULE:CLASS --episodes N [--out DIR] [--seed N] [--seconds S | --ticks N]
                    [--images] [--jobs N] [--address HOST:PORT] [--disk-reserve-mb MB]

    Args:
        WORLD.yaml: main file of the world
        policy: class of the policy, in an installed package or in a file in the current folder
        episodes: makes the episodes 0 to N - 1
        out: folder of the episodes; default: farm
        seed: seed of the farm; the seed of episode n is (N, n); default: 0
        seconds: simulated time after which an episode ends if the policy has not ended it [s]; default: 10
        ticks: number of ticks after which an episode ends, instead of a time
        images: also records the colour images of all cameras, as JPEG
        jobs: number of processes, each of which makes one episode at a time; default: the number of processors
        address: head node of a Ray cluster that makes the episodes, or auto; needs `./rpbi setup farm`
        disk_reserve_mb: free disk space below which no further episode is made [MB]; default: 200
    """
    for flag, value in (("--episodes", episodes), ("--ticks", ticks or 1), ("--jobs", 1 if jobs is None else jobs)):
        if value < 1:
            raise UsageError(f"{flag}: expected at least 1, got {value}")
    if seed < 0 or seconds <= 0.0:
        raise UsageError(f"--seed and --seconds: expected positive numbers, got {seed} and {seconds:g}")
    folder, made = EpisodeFolder(out), Farm(world, policy, seed, seconds, ticks, images)
    with made.claimed(folder):
        numbers = made.missing(folder, episodes)
        labels: Counter[str] = Counter()
        faults = 0
        period_s = 0.1 if sys.stderr.isatty() else 10.0
        bar = tqdm(total=episodes, initial=episodes - len(numbers), unit=" episodes", leave=False, mininterval=period_s)
        try:
            with bar:
                for outcome in made.run(folder, numbers, jobs or os.cpu_count() or 1, address, disk_reserve_mb):
                    if outcome.fault:
                        faults += 1
                        bar.write(f"episode {outcome.number}: {printable(outcome.fault)}")
                    else:
                        labels[outcome.label] += 1
                        bar.update()
        except (EpisodeError, KeyboardInterrupt):
            print(f"{_count(made, folder, episodes)}; the same command continues from there", file=sys.stderr)
            raise
        new = ", ".join(f"{count} {label}" for label, count in labels.most_common()) or "none"
        print(f"{_count(made, folder, episodes)}; new: {new}")
    return 1 if faults else 0


def _count(made: Farm, folder: EpisodeFolder, episodes: int) -> str:
    return f"{episodes - len(made.missing(folder, episodes))} of {episodes} episodes are in {folder.path}"
