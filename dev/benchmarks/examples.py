"""Simulated seconds a second of the examples, and rates of their joint states, sensors and images, by launch file."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import pybullet
import roslaunch.config
from result import Result, Target
from rosgraph.names import ns_join
from session import Session

from custom_ros_tools.config import load_config, replace_package
from rpbi.config.object_entry import ObjectEntry
from rpbi.ros.interface_table import PUBLISHES, endpoints
from rpbi.world import World
from rpbi.world.loading import load_world_dict
from rpbi_examples.scenes import SCENES

LAUNCH = Path(replace_package("{rpbi_examples}/launch"))
LEFT_OUT = {
    "mvn": "has no world",
    "sampling_mpc": "has a world that waits while its candidates are simulated",
    "soft_body": "has soft bodies",
    "teleop": "is moved by a person",
    "telepresence": "has soft bodies",
    "world": "needs a world",
}
"""Launch files that are not measured, and why."""
EXAMPLES = tuple(path.stem for path in sorted(LAUNCH.glob("*.launch")) if path.stem not in LEFT_OUT)
BY_THEMSELVES = {"human_interaction": ["device:=scripted"], "lfd": ["operator:=scripted"]}
"""Arguments with which examples run without a user."""
WITH_FILES = {"human_interaction": "output", "lfd": "out", "pushing_mpc": "out"}
"""Argument of those that write files, for a folder."""
SECONDS, QUICK_SECONDS = 3.0, 1.0
FIRST_SEED = 1
LEAST = Target(0.95, at_least=True)
LONGEST_S = 300.0
"""Longest time of an episode [s]."""
FACTOR = re.compile(r"seed \d+ (\w+).*real-time factor: ([\d.]+)")
HZ = re.compile(r"([\d.]+) Hz")
UNCOUNTED = ("rpbi/status", "rpbi/state", "rpbi/markers", "/tf")
UNCOUNTED_TYPES = ("CameraInfo", "CompressedImage", "PointCloud2", "MarkerArray")
"""Messages that are not of sensors, or are only made for subscribers."""


def run(quick: bool) -> list[Result]:
    """Runs each example alone, and a scene for one episode."""
    return [each for name in EXAMPLES for each in _example(name, QUICK_SECONDS if quick else SECONDS)]


def _example(name: str, seconds: float) -> Iterator[Result]:
    is_scene = name in SCENES
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder, Session() as ros:
        arguments = ["headless:=true", *BY_THEMSELVES.get(name, [])]
        arguments += [f"{WITH_FILES[name]}:={folder}"] if name in WITH_FILES else []
        arguments += [f"seed:={FIRST_SEED}", "episodes:=1"] if is_scene else []
        asked = asked_rates(name, arguments)
        process = ros.start(["roslaunch", "rpbi_examples", f"{name}.launch", *arguments])
        found = ros.result_of(ros.program("rates", seconds, *asked))
        factor = found["factor"]
        if is_scene:
            try:
                process.wait(LONGEST_S)
            except subprocess.TimeoutExpired:
                print(f"{name}: not done after {LONGEST_S:g} s")
            ends = FACTOR.findall(ros.output(process))
            factor = min((float(each) for _, each in ends), default=0.0)
            yield Result("examples", f"{name}: succeeded, of 1", sum(each == "succeeded" for each, _ in ends), "")
    yield Result("examples", f"{name}: real-time factor", factor, "", None, LEAST)
    yield from rate_results(name, asked, found["rates"])


def rate_results(name: str, asked: Mapping[str, float], rates: Mapping[str, float]) -> Iterator[Result]:
    """Yields the least share of the requested rates [Hz], and all others that are too small, by topic."""
    shares = sorted((rates[topic] / hz, topic) for topic, hz in asked.items())
    for index, (share, topic) in enumerate(shares):
        if index == 0 or share < LEAST.limit:
            figure = f"{name}: rate of {topic}, of {asked[topic]:g} Hz"
            yield Result("examples", figure, share, "", None, LEAST)


def asked_rates(name: str, arguments: list[str]) -> dict[str, float]:
    """Returns the rates of joint states, sensors and images in the worlds of a launch file [Hz], by topic.

    Args:
        name: The launch file.
        arguments: Its arguments, such as `headless:=true`.
    """
    launch = roslaunch.config.load_config_default([(str(LAUNCH / f"{name}.launch"), arguments)], None)
    rates: dict[str, float] = {}
    for node in launch.nodes:
        if node.package == "ros_pybullet_interface":
            private = ns_join(node.namespace, node.name) + "/"
            given = {key: each.value for key, each in launch.params.items() if key.startswith(private)}
            rates |= {ns_join(node.namespace, topic): hz for topic, hz in _world_rates(private, given)}
    return rates


def _world_rates(private: str, given: Mapping[str, object]) -> Iterator[tuple[str, float]]:
    file = str(given[f"{private}config_file"])
    overrides: dict[str, object] = {}
    for key, value in given.items():
        *sections, last = key.removeprefix(private).split("/")
        if sections[:1] == ["config"]:
            inner = overrides
            for section in sections[1:]:
                inner = inner.setdefault(section, {})
            inner[last] = value
    data = ObjectEntry(file, overrides).apply_overrides(load_config(file))
    world = World(load_world_dict(data, replace_package(file)), connection_mode=pybullet.DIRECT)
    for each in endpoints(world):
        rate = HZ.fullmatch(each.note)
        if (
            rate
            and each.kind == PUBLISHES
            and each.name not in UNCOUNTED
            and each.type.split("/")[-1] not in UNCOUNTED_TYPES
        ):
            yield each.name, float(rate[1])
    world.close()
