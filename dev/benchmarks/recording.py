"""Messages that recordings lose: in ten minutes with a camera, and when the recorder is stopped or killed."""

from __future__ import annotations

import collections
import hashlib
import os
import random
import signal
import subprocess
import time
from pathlib import Path

import rosbag
from bench_worlds import CAMERA, arm_world
from result import Result, Target
from session import COLOUR, DEPTH, JOINT_STATES, Session

from rpbi_data import EpisodeFolder, Recorder
from rpbi_data.episodes.folder import BAG

HZ = 1000
SECONDS, QUICK_SECONDS = 600.0, 10.0
KILLS, QUICK_KILLS = 100, 5
STOPPED_S = 3.0
TOPICS = [JOINT_STATES, "/tf", "/rpbi/state", "/rpbi/commands"]
IMAGES = [COLOUR, DEPTH]
COUNTED = (JOINT_STATES, *IMAGES)
"""Topics of one publisher each, whose messages are numbered."""
REPAIRED_S = 20.0
ANSWERED_S = 60.0


def run(quick: bool) -> list[Result]:
    """Compares bags with the publishers' own counters, and with the time at which the recorder was killed."""
    seconds, kills = (QUICK_SECONDS, QUICK_KILLS) if quick else (SECONDS, KILLS)
    with Session(use_sim_time=False) as ros:
        os.environ.update(ros.environment)
        ros.place_camera()
        ros.simulator(arm_world(ros.folder, HZ, rgbd_sensor=CAMERA))
        return [
            *_lost(ros.folder, f"{seconds:.0f} s of joint states at 1 kHz and of a camera", seconds, 0.0),
            *_lost(ros.folder, f"recorder stopped for {STOPPED_S:g} s", 2.0, STOPPED_S),
            *_after_kills(ros, kills),
        ]


def _lost(folder: Path, name: str, seconds: float, stopped_s: float) -> list[Result]:
    """Returns the number of messages that were published and are not in the bag."""
    path = folder / "a.bag"
    with Recorder(path, [*TOPICS, *IMAGES]) as recorder:
        time.sleep(seconds)
        assert recorder._process is not None
        recorder._process.send_signal(signal.SIGSTOP)
        time.sleep(stopped_s)
        recorder._process.send_signal(signal.SIGCONT)
        sent = _published(recorder)
    numbers: dict[str, list[int]] = collections.defaultdict(list)
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _ in bag.read_messages(raw=True):
            numbers[topic].append(int.from_bytes(message[1][:4], "little"))  # header.seq counts the published messages
    lost = sum(numbers[topic][-1] - numbers[topic][0] + 1 - len(numbers[topic]) for topic in COUNTED)
    lost += sum(max(count - len(numbers[topic]), 0) for topic, count in sent.items())
    figure = f"{name}: lost of {sum(map(len, numbers.values()))}"
    return [Result("recording", figure, float(lost), "messages", None, Target(0.0))]


def _published(recorder: Recorder) -> dict[str, int]:
    """Returns the publishers' own counts of messages, when all of `COUNTED` have answered."""
    end_s = time.monotonic() + ANSWERED_S
    while missing := set(COUNTED) - (sent := recorder.published()).keys():
        if time.monotonic() > end_s:
            raise RuntimeError(f"no publisher of {', '.join(sorted(missing))} reports a count within {ANSWERED_S:g} s")
    return sent


def _after_kills(ros: Session, kills: int) -> list[Result]:
    """Kills the recorder of one episode after the other at random moments."""
    folder = EpisodeFolder(ros.folder / "episodes")
    ros.set_parameters("/record", {"folder": str(folder.path), "disk_reserve_mb": 100.0})
    ros.node(["rosrun", "episodes", "record_node.py"], "/record/start")
    lost_s, unnamed, touched = 0.0, 0, 0
    hashes: dict[int, str] = {}
    for number in range(kills):
        subprocess.run(["rosservice", "call", "/record/start"], check=True, stdout=subprocess.DEVNULL)
        time.sleep(random.uniform(0.3, 3.0))
        recorders = subprocess.run(["pgrep", "-f", f"bag_writer.*{folder.path}"], capture_output=True, text=True)
        killed_s = time.time()
        os.kill(int(recorders.stdout.split()[0]), signal.SIGKILL)
        end_s = time.monotonic() + REPAIRED_S
        while number not in folder.numbers() and time.monotonic() < end_s:
            time.sleep(0.05)
        episode = folder.read(number)
        unnamed += episode.state != "recovered" or str(episode.messages) not in episode.note
        with rosbag.Bag(str(folder.folder_of(number) / BAG)) as bag:
            lost_s = max(lost_s, killed_s - bag.get_end_time())
        touched += sum(_hash(folder, earlier) != before for earlier, before in hashes.items())
        hashes[number] = _hash(folder, number)
    return [
        Result("recording", f"killed {kills} times: longest loss", lost_s, "s", None, Target(1.0)),
        Result("recording", f"killed {kills} times: without the number of messages", unnamed, "", None, Target(0.0)),
        Result("recording", f"killed {kills} times: earlier episodes that changed", touched, "", None, Target(0.0)),
    ]


def _hash(folder: EpisodeFolder, number: int) -> str:
    return hashlib.sha256((folder.folder_of(number) / BAG).read_bytes()).hexdigest()
