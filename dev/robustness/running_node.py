"""Adds objects of hostile files to a running simulator, and measures how long its world stops meanwhile."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import rosgraph
import rospy
import yaml
from cob_srvs.srv import SetString
from node_world import main_config, remove
from ros_system import RosSystem, stop_group, wait_until
from std_srvs.srv import Trigger
from worlds import FLOOR, ball, iiwa

from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject, ChangeDynamics, ListObjects

from .readers import hostile
from .trials import Outcome

TYPES = {"urdfs": "URDF", "robots": "ROBOT", "dynamic": "DYNAMIC", "soft": "SOFT", "visual": "VISUAL"}
"""Name of the number in PybulletObject by argument of `write_world`."""
LONGEST_MESSAGE = 250_000
"""Characters of an answer."""


class Pauses(NamedTuple):
    """Time between two ticks [s].

    Attributes:
        wall: As it was.
        own: Without the time that its thread waited for a processor; at most the processor time of the process.
        python: Less what PyBullet's functions that load, remove and step took of that.
    """

    wall: float
    own: float
    python: float


class WatchedNode:
    """A simulator that runs at 1 kHz, with a file of its pauses; started again if it ends."""

    def __init__(self, ros: RosSystem, folder: Path) -> None:
        self._ros, self._folder = ros, folder
        self.pauses = folder / "pauses"
        self.pauses.touch()
        self.process: Any = None
        self._seen = 0

    def start(self) -> None:
        """Starts it, and waits until it serves."""
        arm = iiwa(controllers={"springs": {"type": "joint_impedance", "active": False}})
        rospy.set_param(
            "/ros_pybullet_interface/config",
            main_config(self._folder, collision=(FLOOR,), dynamic=(ball(),), robots=(arm,)),
        )
        program = str(Path(__file__).with_name("watched_node.py"))
        self.process = self._ros.start([sys.executable, program, str(self.pauses)])
        wait_until(lambda: "iiwa" in self._ros.call("/rpbi/list_objects", ListObjects).names, "the node serves")
        self._ros.call("/rpbi/start", Trigger)

    def new_output(self) -> str:
        """Returns its output since the last call."""
        said = self._ros.output(self.process)
        new, self._seen = said[self._seen :], len(said)
        return new

    def longest_pauses(self, since_s: float) -> Pauses:
        """Returns its longest pauses since a time [s]."""
        lines = self.pauses.read_text().splitlines()[-2000:]
        rows = [json.loads(line) for line in lines if line.endswith("]")]
        found = [Pauses(0.0, 0.0, 0.0)]
        for now_s, gap_s, waited_s, cpu_s, inside_s in rows:
            if now_s >= since_s:
                own_s = min(gap_s - waited_s, cpu_s)
                found.append(Pauses(gap_s, own_s, own_s - inside_s))
        return Pauses(*map(max, zip(*found, strict=True)))


def outcomes_in_node(workplace: Any, kind: str, seeds: range, folder: Path) -> Iterator[Outcome]:
    """Yields the outcome of each file; prints the longest pauses and the largest size at the end."""
    command = ["rosmaster", "--core", "-p", str(workplace.port.number)]
    master = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    worst: list[tuple[Pauses, int, str]] = []
    try:
        wait_until(rosgraph.is_master_online, "the ROS master answers")
        ros = RosSystem(folder)
        node = WatchedNode(ros, folder)
        node.start()
        for seed in seeds:
            place = folder / f"{kind}{seed}"
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            what, _ = hostile(kind, seed, place)
            began_s = time.monotonic()
            verdict, text = _ask(ros, node, what)
            seconds = time.monotonic() - began_s
            time.sleep(0.003)
            worst.append((node.longest_pauses(began_s), seed, verdict))
            outcome = Outcome(seed, "node", verdict, seconds, text)
            if outcome.is_fine:
                shutil.rmtree(place)
            yield outcome
        status = Path(f"/proc/{node.process.pid}/status").read_text()
        print(f"{kind}: largest size of the node: {status.split('VmHWM:')[1].split('kB')[0].strip()} kB")
        stop_group(node.process)
        ros.processes.remove(node.process)
    finally:
        stop_group(master)
        for name in ("pauses", "world.yaml", "floor.yaml", "ball.yaml", "iiwa.yaml", *(f"{n}.log" for n in range(99))):
            (folder / name).unlink(missing_ok=True)
    for name, pause in (("wall time", "wall"), ("own processor time", "own"), ("outside PyBullet", "python")):
        for wanted in ("refused", "taken"):
            rows = sorted(((getattr(each, pause), seed) for each, seed, got in worst if got == wanted), reverse=True)
            print(f"{kind}: longest pauses [ms], {wanted}, {name}:", *(f"{1e3 * s:.1f} ({n})" for s, n in rows[:5]))


def _ask(ros: RosSystem, node: WatchedNode, what: Any) -> tuple[str, str]:
    """Lets the node add the object of a file; returns the verdict and the answer."""
    try:
        section, given = what
        if isinstance(given, Path):
            answers = _send_yaml(ros, section, given)
        else:
            answers = [_add(ros, TYPES[section], config=yaml.safe_dump(given))]
        verdict, text = ("taken" if answers[0].success else "refused"), "\n".join(each.message for each in answers)
        if answers[0].success:
            remove(ros, answers[0].message.removeprefix("added '").removesuffix("'"))
        if max(len(each.message) for each in answers) > LONGEST_MESSAGE or not text.strip():
            verdict = "silent"
    except (rospy.ServiceException, rospy.ROSException, OSError) as error:
        verdict, text = "traceback", str(error)
    if (code := node.process.poll()) is not None:
        verdict = f"signal {-code}" if code < 0 else f"signal {code}"
        node.start()
    elif "Traceback" in (said := node.new_output()) or "not foreseen" in said:
        verdict, text = "traceback", said[-3000:]
    return verdict, text


def _send_yaml(ros: RosSystem, section: str, file: Path) -> list[Any]:
    """Sends a YAML file as such, and its text to other services that take YAML."""
    text = file.read_bytes().decode(errors="replace")
    answers = [_add(ros, TYPES[section], filename=str(file))]
    answers.append(ros.call("/rpbi/change_dynamics", ChangeDynamics, "ball", text))
    for service in ("set_physics_engine_parameter", "add_rgbd_sensor", "iiwa/springs/set_gains"):
        if f"/rpbi/{service}" in _services():
            answers.append(ros.call(f"/rpbi/{service}", SetString, text))
    return answers


def _services() -> set[str]:
    return {name for name, _ in rosgraph.Master("/tests").getSystemState()[2]}


def _add(ros: RosSystem, kind: str, filename: str = "", config: str = "") -> Any:
    asked = PybulletObject(getattr(PybulletObject, kind), filename, config)
    return ros.call("/rpbi/add_pybullet_object", AddPybulletObject, asked)
