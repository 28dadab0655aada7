"""A short start of the examples whose other tests run only with `./rpbi test --all`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import rosgraph
from node_world import Rosout
from ros_system import Listener, RosSystem, wait_until
from rosgraph_msgs.msg import Log
from roslaunch.config import load_config_default
from workplace import Port

from ros_pybullet_interface.msg import SimulationState

LAUNCH = Path(__file__).resolve().parents[3] / "src/rpbi_examples/launch"
ARGUMENTS = {
    "basic_example_dual_iiwa": [],
    "basic_example_human_model": [],
    "basic_example_kinova": [],
    "basic_example_nextage": [],
    "basic_example_panda": [],
    "basic_example_talos": [],
    "clutter": [],
    "cup": [],
    "dual_arm": [],
    "factory": [],
    "grasp_example": [],
    "handover": [],
    "human_interaction": ["device:=scripted", "output:={folder}"],
    "interpolation": [],
    "kuka_lwr_ik_example": [],
    "lfd": ["operator:=joystick", "virtual:=true", "out:={folder}"],
    "planning_example": [],
    "pushing_mpc": [],
    "pybullet_objects_example": [],
    "pybullet_rgbd_example": [],
    "sampling_mpc": [],
    "shelves": [],
    "soft_body": [],
    "talos": [],
    "telepresence": ["port:={port}"],
    "wiping": [],
    "wiping_example": [],
}
WITHOUT_ROS = {"/mvn_emulator"}
"""Programs that launch files start and that do not register with the master."""
TICKS = 20
SLOW_S = 120.0


@pytest.mark.parametrize("example", ARGUMENTS)
def test_an_example_starts_all_nodes_and_ticks_without_errors(ros: RosSystem, tmp_path: Path, example: str) -> None:
    port = Port().number
    given = ["headless:=true", *(each.format(folder=tmp_path, port=port) for each in ARGUMENTS[example])]
    path = str(LAUNCH / f"{example}.launch")
    loaded = load_config_default([(path, given)], None, assign_machines=False)
    expected = {f"{node.namespace}{node.name}" for node in loaded.nodes} - WITHOUT_ROS
    rosout, states = Rosout(ros), ros.listen("/rpbi/state", SimulationState)
    process = ros.start(["roslaunch", path, *given])
    try:
        wait_until(lambda: process.poll() is not None or expected <= _nodes(), "all nodes are up", SLOW_S)
        wait_until(lambda: process.poll() is not None or _ticks(states) > TICKS, "the world ticks", SLOW_S)
    except TimeoutError as error:
        raise TimeoutError(f"{error}: {expected - _nodes()}\n{ros.output(process)}") from None
    output = ros.output(process)
    assert process.poll() is None, output
    assert not re.search("FATAL|ERROR|Traceback|has died", output), output
    assert [log.msg for log in rosout.logs() if log.level >= Log.ERROR] == []


def _nodes() -> set[str]:
    """Returns all nodes that the master knows."""
    return {node for entries in rosgraph.Master("/tests").getSystemState() for _, nodes in entries for node in nodes}


def _ticks(states: Listener) -> int:
    return states.messages[-1].tick if states.messages else 0
