"""Two computers: the master and an operator on one, the simulator on the other, as docs/network.md has it.

Both are network namespaces of this machine, which takes the rights of root; they are made once for all tests here.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pybullet_data
import pytest
from computers import TwoComputers, why_not
from ros_system import SUPPORT, RosSystem, wait_until
from worlds import iiwa, write_world

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not())

JOINT = "lbr_iiwa_joint_6"
IIWA = str(Path(pybullet_data.getDataPath()) / "kuka_iiwa/model.urdf")
STATES, TARGETS = "/rpbi/iiwa/joint_states", "/rpbi/iiwa/joint_states/target"
OUT_S = 5.0


@pytest.fixture(scope="module")
def ros_of_module(ros_master: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RosSystem]:
    system = RosSystem(tmp_path_factory.mktemp("computers"))
    yield system
    system.close()


@pytest.fixture(scope="module")
def both(ros_of_module: RosSystem, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoComputers]:
    """Has the master on the first computer, and on the second a simulator with simulated time."""
    computers = TwoComputers(ros_of_module)
    try:
        world = write_world(tmp_path_factory.mktemp("world"), robots=(iiwa(),), timeStep=0.005)
        sim_time = ("rosparam", "set", "/use_sim_time", "true")
        wait_until(lambda: not computers.on(computers.first, *sim_time), "the master answers", every_s=0.2)
        node = ("rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py")
        computers.simulator = computers.second.start(*node, f"_config_file:={world}", master=computers.master)
        wait_until(lambda: computers.registered("/ros_pybullet_interface"), "the simulator is known")
        yield computers
    finally:
        for process in reversed(ros_of_module.processes):
            process.terminate()
        for process in ros_of_module.processes:
            process.wait(60.0)
        computers.close()


Reports = Callable[[], list[dict[str, Any]]]


def _operator(ros: RosSystem, both: TwoComputers, ip: str, targets: str = TARGETS) -> Reports:
    """Starts an operator on the first computer, in place of the one before; returns what gives its lines."""
    both.on(both.first, "rosnode", "kill", "/operator")
    program = (sys.executable, str(SUPPORT / "programs/far_operator.py"), STATES, targets, JOINT, "50", "0.4")
    process = both.first.start(*program, "__name:=operator", master=both.master, ROS_IP=ip)
    lines: Reports = lambda: [json.loads(line) for line in ros.output(process).splitlines() if line[:1] == "{"]  # noqa: E731
    wait_until(lambda: lines() and lines()[-1]["position"] > 0.1, "the robot of the second computer swings")
    return lines


@pytest.fixture(scope="module")
def reports(ros_of_module: RosSystem, both: TwoComputers) -> Reports:
    """Returns what gives the reports of an operator on the cable."""
    return _operator(ros_of_module, both, both.first.cable_ip)


@pytest.mark.thorough
def test_topics_services_and_simulated_time_come_to_the_other_computer(both: TwoComputers, reports: Reports) -> None:
    assert "xmlrpc reply from http://10.77.0.2:" in both.on(
        both.first, "rosnode", "ping", "-c1", "/ros_pybullet_interface"
    )
    assert "- iiwa" in both.on(both.first, "rosservice", "call", "/rpbi/list_objects")
    assert reports()[-1]["stamp_s"] < 1e6, "stamps are simulated"
    clock = both.on(both.first, "rostopic", "echo", "-n1", "/clock")
    assert 0 < int(clock.split("secs:")[1].split()[0]) < 1e6


@pytest.mark.thorough
def test_connections_recover_by_themselves_after_a_network_failure(both: TwoComputers, reports: Reports) -> None:
    both.plug(False)
    time.sleep(OUT_S)
    out = reports()[-1]
    both.plug(True)
    wait_until(lambda: reports()[-1]["stamp_s"] > out["stamp_s"] + OUT_S, "joint states of the present come")
    wait_until(lambda: abs(reports()[-1]["position"] - reports()[-1]["target"]) < 0.05, "the robot follows again")
    wait_until(lambda: reports()[-1]["position"] > 0.3, "it swings")
    wait_until(lambda: reports()[-1]["position"] < 0.1, "and back")
    assert both.simulator.poll() is None


@pytest.mark.thorough
def test_targets_with_20_ms_of_jitter_move_the_robot(
    ros_of_module: RosSystem, both: TwoComputers, reports: Reports
) -> None:
    both.switch_radio_on(0.0, 0.02)
    lines = _operator(ros_of_module, both, both.first.radio_ip)
    wait_until(lambda: len(lines()) > 20, "some seconds have gone")
    assert lines()[-1]["lag_s"] < 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("side", ["first", pytest.param("second", marks=pytest.mark.thorough)])
def test_a_guard_on_either_side_lets_a_swing_through(ros_of_module: RosSystem, both: TwoComputers, side: str) -> None:
    targets = f"/{side}/targets"
    parameters = {
        "robot_description": IIWA,
        "policy": "limit",
        "period_s": 0.02,
        "shape": {"time_s": 0.06},
        "silence_s": 2.0,  # a busy machine is no fault of the network
        "limits": {"acceleration": 10.0, "jerk": 1000.0},
        "checks": {"staleness": {"timeout_s": 4.0}},
    }
    given = [f"_{name}:={json.dumps(value)}" for name, value in parameters.items()]
    names = (f"joint_states/target:={targets}", f"joint_states/command:={TARGETS}", f"joint_states/measured:={STATES}")
    computer = both.first if side == "first" else both.second
    guard = computer.start(
        "rosrun", "safe_robot", "safe_robot_node.py", f"__name:=guard_{side}", *names, *given, master=both.master
    )
    wait_until(lambda: both.registered(f"/guard_{side}"), "the guard is known")
    lines = _operator(ros_of_module, both, both.first.cable_ip, targets)
    swings = len(lines())
    wait_until(lambda: len(lines()) > swings + 20, "the arm has swung for five seconds")
    both.on(both.first, "rosnode", "kill", f"/guard_{side}")
    positions = [line["position"] for line in lines()[swings:]]
    assert max(positions) - min(positions) > 0.35
    assert [line for line in ros_of_module.output(guard).splitlines() if "halted" in line] == []


FAULTS = {
    "of no computer here": (
        "10.99.0.9",
        "ROS_IP is 10.99.0.9, which is no address of this computer: other nodes cannot",
    ),
    "of itself": (
        "127.0.0.1",
        "ROS_IP is 127.0.0.1, which only this computer reaches, but the ROS master is at http://10",
    ),
    "of another network": (
        "10.79.0.2",
        "ROS_IP is 10.79.0.2, but this computer reaches the ROS master at http://10.77",
    ),
    "right": ("10.77.0.2", ""),
}


@pytest.fixture(scope="module")
def said(ros_of_module: RosSystem, both: TwoComputers) -> dict[str, Callable[[], str]]:
    """Starts a node of ours on the second computer with each address; returns what gives all that it has said."""
    both.second.ip("address", "add", "10.79.0.2/24", "dev", "lo")
    script = (
        "import rospy; from custom_ros_tools.ros.lifecycle.run_node import run_node\n"
        "run_node('node', lambda: rospy.logwarn('it is up'))"
    )
    found = {}
    for case, (ip, _) in FAULTS.items():
        name = f"__name:=with_{ip.replace('.', '_')}"
        process = both.second.start(sys.executable, "-c", script, name, master=both.master, ROS_IP=ip)
        found[case] = lambda process=process: ros_of_module.output(process)
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("case", FAULTS)
def test_unreachable_address_is_reported_in_one_line(said: dict[str, Callable[[], str]], case: str) -> None:
    wait_until(lambda: "it is up" in said[case](), "the node is up")
    warnings = [line for line in said[case]().splitlines() if "ROS_IP" in line]
    expected = FAULTS[case][1]
    assert len(warnings) == bool(expected)
    if expected:
        assert expected in warnings[0] and "export ROS_IP=10.77.0.2 in this terminal" in warnings[0]
