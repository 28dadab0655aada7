"""`human_interaction.launch`: an arm presses on a box by itself, and the force is what stiffness and depth predict."""

from __future__ import annotations

import csv
import re

import pytest
import rospy
from PIL import Image
from ros_system import stop_group, wait_until

MEAN = re.compile(r"at a depth of ([\d.]+) mm: ([\d.]+) N on the tool, by stiffness ([\d.]+) N")
STIFFNESS = 500.0
TOUCH_HEIGHT_M = 0.135


@pytest.mark.thorough
def test_one_press_and_release(ros, tmp_path):
    """The folder of the output is not there before, and roslaunch ends as if it were interrupted."""
    folder = tmp_path / "new" / "folder"
    arguments = ["device:=scripted", "headless:=true", f"output:={folder}", "seed:=1"]
    process = ros.start(["roslaunch", "rpbi_examples", "human_interaction.launch", *arguments])
    wait_until(lambda: process.poll() is not None, "it ends by itself")
    output = ros.output(process)
    assert rospy.get_param("/ik_ros/interface") == "pybullet", "as the paper's section 3.1 has it"
    found = MEAN.search(output)
    assert found, output
    if "REQUIRED process" in output and "too slow: real-time factor" in output:
        pytest.skip("the handle has the wall's time, and the simulator warned that this computer is too slow for it")
    assert "REQUIRED process" not in output, output
    assert process.returncode == 0
    refused = [line for line in output.splitlines() if "guarded/joint_states/target" in line]
    assert not [line for line in refused if "joint_jerk" in line or "joint_acceleration" in line], refused
    depth_m, measured_n = float(found[1]) / 1e3, float(found[2])
    assert depth_m > 0.003
    assert measured_n == pytest.approx(STIFFNESS * depth_m, rel=0.05)
    with open(folder / "human_interaction.csv") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    deepest = min(rows, key=lambda row: row["tool_z"])
    assert deepest["tool_z"] <= TOUCH_HEIGHT_M - depth_m
    assert rows[0]["tool_z"] > TOUCH_HEIGHT_M and rows[-1]["tool_z"] > TOUCH_HEIGHT_M, "it was pressed, and released"
    assert max(abs(row["felt_n"]) for row in rows) <= 10.0
    assert max(row["felt_n"] for row in rows) > 0.5
    with Image.open(folder / "human_interaction.png") as picture:
        assert len(picture.convert("RGB").getcolors(1 << 20)) > 10, "it shows something"


def test_an_interrupt_ends_the_node_while_it_waits_for_others(ros, tmp_path):
    options = [f"_{key}:=1.0" for key in ("stiffness", "force_scale", "touch_height")]
    node = ros.start(["rosrun", "rpbi_examples", "human_interaction_node.py", f"_output:={tmp_path}", *options])
    wait_until(lambda: "still waiting for service" in ros.output(node), "it waits for the sensor's service")
    assert stop_group(node) == 0
