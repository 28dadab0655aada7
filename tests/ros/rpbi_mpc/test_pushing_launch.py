"""`pushing_mpc.launch`, from the launch file to a box at the end of its path: stepped, and by a real robot."""

from __future__ import annotations

import json
import math
import os
import re

import numpy as np
import pytest
from nav_msgs.msg import Path
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from ros_pybullet_interface.srv import SetSensorRate
from rpbi_mpc.msg import MpcStatus
from rpbi_utils.msg import DriverState

SLOW_S = 120.0
SLOW = re.compile("too slow: a cycle takes|the task is not done: the solver took .* ms, expected at most")
"""Messages by which the node says that the computer is too slow for a real robot."""
START, END, HEIGHT = (0.33, -0.3), (0.33, -0.08), 0.712
"""Ends of the line, and height of what RViz shows [m]."""
REPORT = ("cycles.csv", "path.png", "errors.png", "cycles.png")
LINE = ("headless:=true", "path:=line")


def summary_of(ros: RosSystem, process, folder) -> dict:
    """Waits until the launch ends after its success, and returns the report's summary."""
    wait_until(lambda: process.poll() is not None, "it ends by itself", SLOW_S)
    assert process.returncode == 0 and "REQUIRED process" not in ros.output(process), ros.output(process)
    return json.loads((folder / "summary.json").read_text())


def hide_for_a_while(ros: RosSystem, process) -> None:
    """Turns Vicon off and on again between single steps, and compares positions of the joints meanwhile."""
    joints = ros.listen("rpbi/nextage/joint_states", JointState)
    assert ros.call("rpbi/set_sensor_rate", SetSensorRate, "vicon/box/box", 0.0).success
    answers = [ros.call("mpc/step", Trigger).message for _ in range(7)]
    assert answers[3].endswith(": solved") and answers[-1].endswith("expected one at least every 0.2 s"), answers
    stood = joints.messages[-1].position
    assert ": waiting: /vicon/box/box: no pose for" in ros.call("mpc/step", Trigger).message
    assert joints.messages[-1].position == pytest.approx(stood, abs=1e-4), "the robot stands"
    assert ros.output(process).count("waiting: /vicon/box/box: no pose for") == 1, "one line"
    assert ros.call("rpbi/set_sensor_rate", SetSensorRate, "vicon/box/box", 100.0).success
    answers = [ros.call("mpc/step", Trigger).message for _ in range(2)]
    assert answers[-1].endswith(": solved"), answers


def check_display(path, prediction, markers) -> None:
    """Checks frames and places of what RViz shows."""
    along = np.array([(each.pose.position.x, each.pose.position.y) for each in path.messages[-1].poses])
    assert along[0] == pytest.approx(START, abs=1e-3) and along[-1] == pytest.approx(END, abs=1e-3)
    assert len(prediction.messages) > 100
    for message in (path.messages[-1], *prediction.messages):
        assert {message.header.frame_id, *(each.header.frame_id for each in message.poses)} == {"rpbi/world"}
        places = np.array([(each.pose.position.x, each.pose.position.y) for each in message.poses])
        assert np.hypot(*(places[:, None] - along).T).min(axis=0).max() < 0.02, "predictions are beside the path"
        assert {each.pose.position.z for each in message.poses} == {HEIGHT}
    for marker in markers.messages[-1].markers:
        sides = np.diff([(each.x, each.y) for each in marker.points], axis=0)
        assert marker.header.frame_id == "rpbi/world" and np.hypot(*sides.T) == pytest.approx([0.1] * 4)
        assert np.hypot(*(np.mean([(each.x, each.y) for each in marker.points[:4]], axis=0) - END)) < 0.02


@pytest.mark.thorough
def test_hand_pushes_by_single_steps_and_to_the_paths_end(ros: RosSystem, tmp_path) -> None:
    status = ros.listen("mpc/status", MpcStatus)
    shown = (ros.listen("mpc/path", Path), ros.listen("mpc/prediction", Path), ros.listen("mpc/markers", MarkerArray))
    arguments = (*LINE, "start_on_init:=false", f"out:={tmp_path}")
    process = ros.start(["roslaunch", "rpbi_examples", "pushing_mpc.launch", *arguments])
    for index in range(3):
        answer = ros.call("mpc/step", Trigger)
        assert answer.success and answer.message.startswith(f"cycle {index}: "), answer.message
    wait_until(lambda: status.messages and status.messages[-1].cycle == 2, "the status of the third cycle")
    assert not status.messages[-1].running and status.messages[-1].status == "solved"
    hide_for_a_while(ros, process)
    assert not ros.call("mpc/stop", Trigger).success
    assert ros.call("mpc/start", Trigger).success
    refused = ros.call("mpc/step", Trigger)
    assert not refused.success and refused.message == "the loop is running; call mpc/stop first"
    summary = summary_of(ros, process, tmp_path)
    assert summary["finished"] and summary["mean_error_mm"] < 5.0, summary
    assert summary["by_status"]["solved"] > 100
    assert all((tmp_path / name).stat().st_size > 10_000 for name in REPORT)
    check_display(*shown)


@pytest.mark.alone
@pytest.mark.thorough
def test_guarded_real_robot_pushes_with_the_same_launch_file(ros: RosSystem, tmp_path) -> None:
    driver = ros.listen("/stand_in/driver_state", DriverState)
    arguments = (*LINE, "real_robot:=true", f"out:={tmp_path}")
    process = ros.start(["roslaunch", "rpbi_examples", "pushing_mpc.launch", *arguments])
    try:
        summary = summary_of(ros, process, tmp_path)
        assert driver.messages[-1].reflexes == 0, driver.messages[-1].message
        assert summary["finished"] and summary["mean_error_mm"] < 15.0, ros.output(process)
    except AssertionError:
        if SLOW.search(ros.output(process)):
            pytest.skip("the real robot has the wall's time, and the node said that this computer is too slow for it")
        raise


@pytest.mark.thorough
def test_pushes_are_tried_in_forks_of_the_world(ros: RosSystem) -> None:
    status = ros.listen("mpc/status", MpcStatus)
    arguments = (*LINE, "start_on_init:=false", "controller:=sampling")
    ros.start(["roslaunch", "rpbi_examples", "pushing_mpc.launch", *arguments])
    for _ in range(30):
        assert ros.call("mpc/step", Trigger).message.endswith((": solved", "no pose yet, expected one"))
        if status.messages and math.isfinite(status.messages[-1].cost) and status.messages[-1].iterations:
            break  # the hand was on its way to the box before
    assert 0.0 < status.messages[-1].cost < 100.0 and status.messages[-1].iterations == 1, "the program needs more"


WRONG = {
    "path:=circle": "circle",
    "speed:=-1.0": "~config: pushing.path.speed: must be > 0 [m/s], got -1",
    "controller:=sampling real_robot:=true": "~config: controller: expected program with plant.timed",
}
"""Arguments, and what the message has."""


@pytest.mark.parametrize("arguments", WRONG)
def test_wrong_arguments_are_errors_with_their_key(ros: RosSystem, arguments: str) -> None:
    process = ros.start(["roslaunch", "rpbi_examples", "pushing_mpc.launch", "headless:=true", *arguments.split()])
    wait_until(lambda: process.poll() is not None, "it ends by itself", SLOW_S)
    assert WRONG[arguments] in ros.output(process)


def test_missing_extra_ends_all_nodes_with_one_line(ros: RosSystem, tmp_path) -> None:
    (tmp_path / "casadi.py").write_text("raise ImportError('none here', name='casadi')\n")
    modules = os.pathsep.join((str(tmp_path), os.environ["PYTHONPATH"]))
    process = ros.start(["roslaunch", "rpbi_examples", "pushing_mpc.launch", *LINE], PYTHONPATH=modules)
    wait_until(lambda: process.poll() is not None, "it ends by itself", SLOW_S)
    output = ros.output(process)
    (line,) = (line for line in output.splitlines() if "not installed" in line)
    assert "'casadi' is not installed: ./rpbi setup mpc" in line and "FATAL" in line, output
    assert "Traceback" not in output and output.count("FATAL") == 1, output
