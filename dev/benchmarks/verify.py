"""Whether recorded episodes of four examples simulate again to the same states, and whether a changed file is named."""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bench_worlds import arm_world
from result import Result, Target
from session import Session

from rpbi_data import EpisodeFolder
from rpbi_data.episodes.verified_messages import verify_all


class Scene(NamedTuple):
    """An example whose episodes are recorded.

    Attributes:
        launch: Its launch file and arguments.
        ready: Service that it offers when it is up.
        program: One of `programs/` that takes the person's part, None without people.
        longest_s: Length of the longest episode, in wall time [s].
    """

    launch: tuple[str, ...]
    ready: str
    program: str | None = None
    longest_s: float = 1.8


FAST = "real_time_factor:=0"
SCENES = {
    "pushing": Scene(("basic_example_kuka_lwr.launch", FAST), "/rpbi/reset"),
    "grasping": Scene(("grasp_example.launch", FAST), "/rpbi/reset"),
    "wiping": Scene(("wiping_example.launch", FAST), "/rpbi/reset"),
    "a person's stick": Scene(("teleop.launch", "device:=joystick"), "/toggle_teleop_tf", "stick", 3.0),
}
EPISODES, QUICK_EPISODES = 250, 3
HOURS_S, QUICK_HOURS_S = 7200.0, 120.0
"""Length of the episode with keyframes, in simulated time [s]."""
HZ, KEYFRAME_S = 50.0, 60.0
"""Steps a second of its world, and period of its keyframes [s]."""
BOX = "{rpbi_examples}/configs/basic_example_kuka_lwr/box.yaml"
SHORTEST_S = 0.6
"""Length of the shortest episode, in wall time [s]."""
CHANGED = 20
"""Number of episodes of a scene that are verified with a changed file."""
DIGIT = re.compile(r"(baseMass|lateralFriction|timeStep|gravZ|rollingFriction): *-?[\d.]*?([1-9])")


def run(quick: bool) -> list[Result]:
    """Records episodes of each scene, and verifies them in fresh processes, as `./rpbi verify` does."""
    with tempfile.TemporaryDirectory() as root:
        folders = {name: EpisodeFolder(Path(root) / name.replace(" ", "_")) for name in SCENES}
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # a recorder mostly waits
            recordings = [
                pool.submit(_record, SCENES[name], folders[name], QUICK_EPISODES if quick else EPISODES)
                for name in SCENES
            ]
        for recording in recordings:
            recording.result()
        results = [result for name in SCENES for result in _verified(name, folders[name])]
        return [*results, *_hours(EpisodeFolder(Path(root) / "hours"), QUICK_HOURS_S if quick else HOURS_S)]


def _verified(name: str, folder: EpisodeFolder) -> list[Result]:
    numbers = folder.numbers()
    same = 0
    for verdict in verify_all(folder, numbers, os.cpu_count() or 1, ()):
        same += verdict.is_same
        if not verdict.is_same:
            print(f"{name}: episode {verdict.number}: {verdict.text}", file=sys.stderr, flush=True)
    named, affected = _named_after_a_change(folder, numbers[:CHANGED])
    changed = f"{name}: named after one digit of a file was changed, of {affected}"
    return [
        Result("verify", f"{name}: the same, of {len(numbers)}", same, "", None, Target(len(numbers), True)),
        Result("verify", changed, named, "", None, Target(affected, True)),
    ]


def _hours(folder: EpisodeFolder, seconds: float) -> list[Result]:
    """Records one long episode with keyframes as fast as it goes, and times its verification."""
    with Session() as ros:
        main = {"real_time_factor": 0, "keyframe_every_s": KEYFRAME_S, "dynamic_objects": [BOX]}
        ros.simulator(arm_world(ros.folder, HZ, HZ / 10.0, False, **main))
        ros.set_parameters("/record", {"folder": str(folder.path), "reset": True, "disk_reserve_mb": 100.0})
        ros.node(["rosrun", "episodes", "record_node.py"], "/record/start")
        ros.result_of(ros.program("record_hours", seconds), timeout_s=seconds)
    what = f"an episode of {seconds:g} s with a keyframe each {KEYFRAME_S:g} s"
    results = []
    for jobs in (1, 2):
        begin_s = time.perf_counter()
        (verdict,) = verify_all(folder, folder.numbers(), jobs, ())
        taken_s = time.perf_counter() - begin_s
        results += [
            Result("verify", f"{what}, {jobs} processes: wall time", taken_s, "s"),
            Result("verify", f"{what}, {jobs} processes: the same", int(verdict.is_same), "", None, Target(1, True)),
        ]
    return results


def _record(scene: Scene, folder: EpisodeFolder, count: int) -> None:
    lengths = np.random.default_rng(len(scene.launch)).uniform(SHORTEST_S, scene.longest_s, count).round(2).tolist()
    with Session() as ros:
        _record_in(ros, scene, folder, lengths)
    if len(folder.numbers()) != count:
        raise RuntimeError(f"{scene.launch[0]}: {len(folder.numbers())} episodes of {count} were recorded")


def _record_in(ros: Session, scene: Scene, folder: EpisodeFolder, lengths: list[float]) -> None:
    ros.node(["roslaunch", "rpbi_examples", *scene.launch, "headless:=true"], scene.ready)
    if scene.program:
        ros.program(scene.program)
    ros.set_parameters("/record", {"folder": str(folder.path), "reset": True, "disk_reserve_mb": 100.0})
    ros.node(["rosrun", "episodes", "record_node.py"], "/record/start")
    ros.result_of(ros.program("record_episodes", json.dumps(lengths)), timeout_s=60.0 + 10.0 * sum(lengths))


def _named_after_a_change(folder: EpisodeFolder, numbers: list[int]) -> tuple[int, int]:
    """Changes one digit of the stored copy of a world file.

    Returns:
        The number of episodes that are named, and the number of those that have this file.
    """
    copy = next(path for path in sorted(folder.files.glob("*.yaml")) if DIGIT.search(path.read_text()))
    found = DIGIT.search(text := copy.read_text())
    assert found is not None
    start, end = found.span(2)
    copy.write_text(text[:start] + str(int(found[2]) % 9 + 1) + text[end:])
    affected = [number for number in numbers if copy.stem in json.dumps(folder.read(number).files)]
    verdicts = verify_all(folder, affected, os.cpu_count() or 1, ())
    return sum(copy.stem in verdict.text and not verdict.is_same for verdict in verdicts), len(affected)
