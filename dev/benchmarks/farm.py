"""Checks that a farm whose workers are killed makes the same episodes as one undisturbed process."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from result import Result, Target

from rpbi_data import EpisodeFolder
from rpbi_data.episodes.folder import BAG
from rpbi_data.episodes.verified_messages import verify_all
from rpbi_data.farm.ros.farm import WORKER

ROOT = Path(__file__).resolve().parents[2]
WORLD = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
EPISODES, KILLS, VERIFIED = 200, 10, 20
QUICK_EPISODES, QUICK_KILLS, QUICK_VERIFIED = 12, 2, 2
TICKS = 600
POLL_S = 0.02
LONGEST_PAUSE_S = 0.5
"""Longest time from a due kill until it happens [s]."""


def run(quick: bool) -> list[Result]:
    """Kills random workers at random moments, and compares the bags, whose messages have the hashes of the states."""
    episodes, kills = (QUICK_EPISODES, QUICK_KILLS) if quick else (EPISODES, KILLS)
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as place:
        alone, disturbed = Path(place) / "alone", Path(place) / "disturbed"
        begin_s = time.perf_counter()
        _finish(_start(alone, episodes, 1))
        alone_s = time.perf_counter() - begin_s
        begin_s = time.perf_counter()
        killed = _kill_workers(_start(disturbed, episodes, os.cpu_count() or 1), disturbed, episodes, kills)
        disturbed_s = time.perf_counter() - begin_s
        expected, found = _digests(alone), _digests(disturbed)
        same = sum(found.get(number) == each for number, each in expected.items())
        numbers = sorted(found)[: QUICK_VERIFIED if quick else VERIFIED]
        verdicts = list(verify_all(EpisodeFolder(disturbed), numbers, os.cpu_count() or 1, ()))
        labels = [episode.label for episode in EpisodeFolder(disturbed).all()]
    what = f"{episodes} episodes of {TICKS} ticks of the KUKA"
    return [
        Result("farm", "workers killed", killed, "", None, Target(kills, at_least=True)),
        Result("farm", f"episodes there, of {episodes}", len(found), "", None, Target(episodes, at_least=True)),
        Result("farm", f"equal to those of one process, of {episodes}", same, "", None, Target(episodes, True)),
        Result(
            "farm",
            f"verified, of {len(numbers)}",
            sum(each.is_same for each in verdicts),
            "",
            None,
            Target(len(numbers), True),
        ),
        Result("farm", "episodes that succeed", labels.count("success"), ""),
        Result("farm", f"{what}: one process", alone_s, "s"),
        Result("farm", f"{what}: {os.cpu_count()} processes, with kills", disturbed_s, "s"),
    ]


def _start(folder: Path, episodes: int, jobs: int) -> subprocess.Popen[Any]:
    command = [sys.executable, str(ROOT / "devel/lib/custom_ros_tools/console"), "farm", WORLD, "--out", str(folder)]
    command += ["--policy", "push_policy:Push", "--ticks", str(TICKS), "--episodes", str(episodes)]
    command += ["--jobs", str(jobs)]
    return subprocess.Popen(command, cwd=ROOT / "dev/benchmarks/programs", stderr=subprocess.DEVNULL)


def _finish(farm: subprocess.Popen[Any]) -> None:
    if farm.wait():
        raise RuntimeError(f"expected the farm to end with 0, got {farm.returncode}")


def _kill_workers(farm: subprocess.Popen[Any], folder: Path, episodes: int, kills: int) -> int:
    """Kills a random worker each time a share of the episodes is complete; returns the number of killed workers."""
    chance, killed = random.Random(episodes), 0
    while farm.poll() is None and killed < kills:
        if len(list(folder.glob("episode_*"))) >= killed * episodes // (kills + 1):
            time.sleep(chance.uniform(0.0, LONGEST_PAUSE_S))
            if workers := _workers(farm.pid):
                os.kill(chance.choice(workers), signal.SIGKILL)
                killed += 1
        time.sleep(POLL_S)
    _finish(farm)
    return killed


def _workers(farm: int) -> list[int]:
    try:
        children = Path(f"/proc/{farm}/task/{farm}/children").read_text().split()
        return [int(each) for each in children if WORKER.encode() in Path(f"/proc/{each}/cmdline").read_bytes()]
    except OSError:  # one has just ended
        return []


def _digests(folder: Path) -> dict[int, str]:
    episodes = EpisodeFolder(folder)
    return {
        number: hashlib.sha256((episodes.folder_of(number) / BAG).read_bytes()).hexdigest()
        for number in episodes.numbers()
    }
