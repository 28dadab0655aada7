"""The loop at 1 kHz with all loads at once, compared with a bare rospy publisher."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import rosbag
from bench_worlds import CAMERA, crowded_world, write_main
from loop import publisher_alone
from result import Result
from session import COLOUR, DEPTH, JOINT_STATES, Session

HZ = 1000
TF_HZ = 50
CLOCK_SUBSCRIBERS = 3


def run(quick: bool) -> list[Result]:
    """Measures the rate that is kept with 30 objects on TF, a recorder, subscribers of /clock, a stopped one, and the
    camera.
    """
    seconds = 8.0 if quick else 30.0
    floor = publisher_alone(HZ, seconds / 2)
    with Session() as ros:
        world = crowded_world(ros.folder, HZ, rgbd_sensor=CAMERA)
        alone = ros.program("step_alone", write_main(ros.folder, world), seconds / 4, HZ)
        alone_s = ros.result_of(alone)
        ros.place_camera()
        ros.simulator(world)
        bag = ros.folder / "load.bag"
        everything_but_images = ["-a", "-x", ".*/(image|segmentation)"]
        recorder = ros.start(["rosbag", "record", *everything_but_images, "-O", str(bag)])
        for _ in range(CLOCK_SUBSCRIBERS):
            ros.watch("/clock")
        stopped = ros.watch(JOINT_STATES, stock=False)
        os.kill(stopped.process.pid, signal.SIGSTOP)
        images = ros.watch(COLOUR, DEPTH, seconds=seconds, stock=False)
        found = ros.watch(JOINT_STATES, seconds=seconds, stock=False).arrivals()[JOINT_STATES]
        seen = images.arrivals()
        ros.stop(recorder)
        if not bag.exists():
            raise RuntimeError(f"nothing was recorded:\n{ros.output(recorder)}")
        recorded = _recorded(bag)
    return [
        Result("load", "physics alone", alone_s * 1e6, "us/step"),
        Result("load", "joint states received", found.rate_hz, "1/s", floor.rate_hz),
        Result("load", "real-time factor", found.real_time_factor, "", floor.real_time_factor),
        *(Result("load", f"lateness p{p}", found.lateness_ms(p), "ms", floor.lateness_ms(p)) for p in (50, 99)),
        Result("load", "TF recorded, share of its rate", recorded["/tf"] / TF_HZ, ""),
        Result("load", "joint states recorded, share of their rate", recorded[JOINT_STATES] / HZ, ""),
        Result("load", "colour images received", seen[COLOUR].rate_hz, "1/s"),
        Result("load", "depth images received", seen[DEPTH].rate_hz, "1/s"),
        Result("load", "overruns", recorded["overruns"], "1/s"),
    ]


def _recorded(path: Path) -> dict[str, float]:
    """Returns messages a stamped second by topic, and overruns a second of wall time."""
    rates = {}
    with rosbag.Bag(str(path)) as bag:
        for topic in ("/tf", JOINT_STATES):
            stamps_s = [_stamp(message).to_sec() for _, message, _ in bag.read_messages(topic)]
            rates[topic] = (len(stamps_s) - 1) / float(np.ptp(stamps_s))
        overruns = [
            int(item.value)
            for _, message, _ in bag.read_messages("/diagnostics")
            for item in message.status[0].values
            if item.key == "overruns_in_last_period"
        ]
    rates["overruns"] = float(np.mean(overruns))
    return rates


def _stamp(message: object) -> object:
    return message.transforms[0].header.stamp if hasattr(message, "transforms") else message.header.stamp
