"""From a recording of a running simulator to the parameters of its twin, also as on docs/identification.md."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any
from xmlrpc.client import ServerProxy

import numpy as np
import pytest
import rosbag
import rosgraph
import rospy
import yaml
from page_blocks import ROOT, blocks_of
from page_runs import agree
from ros_system import RPBI, stop_group, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from ros_pybullet_interface.msg import PlannedInput
from ros_pybullet_interface.srv import ListObjects, StepN, StepWithInputs
from rpbi_reality.evaluation import world_file
from rpbi_reality.identification.fit_config import FitConfig
from rpbi_reality.identification.identify import identify_world

GAIN, DELAY_S, STEP_S = 0.07, 0.012, 0.004
STEPS = 1000
FIT = {
    "runs": {"count": 1},
    "measured": {"arm": {"object": "arm", "joint_sigma": 0.001}},
    "parameters": {
        "gain": {"set": "arm.setJointMotorControlArray.positionGains", "bounds": [0.01, 0.2], "scale": "log"},
        "delay": {"set": "inputs.arm/target.delay_s", "bounds": [0.0, 0.05]},
    },
}


def _world(**motors: float) -> dict[str, Any]:
    arm: dict[str, Any] = {"file": world_file("identification/arm.yaml"), "joint_state_publisher_hz": 250.0}
    return {
        "connect": {"connection_mode": "DIRECT"},
        "timeStep": STEP_S,
        "start_pybullet_after_initialization": False,
        "robots": [arm | ({"setJointMotorControlArray": motors} if motors else {})],
    }


@pytest.mark.thorough
def test_gain_and_delay_of_a_recorded_arm_are_found(ros, tmp_path):
    ros.simulator(_world(positionGains=GAIN), use_sim_time=True)
    states = ros.listen("/rpbi/arm/joint_states", JointState)
    before = ros.call("/rpbi/step_n", StepN, 1)
    goals = np.random.default_rng(4).uniform(-1.0, 1.0, 8).tolist()
    planned = [PlannedInput(25 + 120 * i, "arm/target", ["shoulder"], [goal]) for i, goal in enumerate(goals)]
    answer = ros.call("/rpbi/step_with_inputs", StepWithInputs, STEPS, planned)
    assert answer.success, answer.message
    wait_until(lambda: states.stamps_ns and states.stamps_ns[-1] == answer.stamp.to_nsec(), "the last tick arrives")
    recorded = [message for message in states.messages if message.header.stamp >= before.stamp]
    assert len(recorded) > STEPS * 0.9
    path = tmp_path / "run.bag"
    with rosbag.Bag(str(path), "w") as bag:
        for message in recorded:
            bag.write("/rpbi/arm/joint_states", message, message.header.stamp)
        for each in planned:
            sent = JointState(name=list(each.names), position=list(each.values))
            sent.header.stamp = before.stamp + rospy.Duration.from_sec(each.tick * STEP_S - DELAY_S)
            bag.write("/rpbi/arm/joint_states/target", sent, sent.header.stamp)
    twin = tmp_path / "world.yaml"
    twin.write_text(yaml.safe_dump(_world()))
    found = identify_world(str(twin), path, FitConfig.parse(FIT, "fit.yaml"), 1)
    assert found.values["gain"] == pytest.approx(GAIN, rel=0.02)
    # with delays of 12 to 13.7 ms, the twin moves exactly as recorded
    assert found.values["delay"] == pytest.approx(DELAY_S + STEP_S / 4.0, abs=STEP_S / 4.0)
    assert found.after.mean < 1e-3 < 1.0 < found.before.mean


def _recorded(simulator: str) -> set[str]:
    """Returns the topics that a node sends to rosbag: it is connected, not only registered."""
    info = ServerProxy(rosgraph.Master("/tests").lookupNode(simulator)).getBusInfo("/tests")[2]
    return {
        topic
        for _, to, direction, _, topic, connected, *_ in info
        if "/record_" in to and direction == "o" and connected
    }


@pytest.mark.alone
@pytest.mark.thorough
def test_the_twin_of_the_page_moves_like_the_laboratory(ros, tmp_path):
    started, recorded = (command.split() for command, _ in blocks_of("docs/identification.md", "shell")[0].commands)
    [(identify, shown)] = blocks_of("docs/identification.md", "console")[0].commands
    [script] = [each.text for each in blocks_of("docs/identification.md", "python") if "rospy" in each.text]
    world = started[2].replace("src/", f"{ROOT}/src/")
    ros.start([RPBI, "launch", world, *started[3:]])
    ros.call("/rpbi/list_objects", ListObjects)
    recorder = ros.start([*recorded[:2], "-O", str(tmp_path / "run.bag"), *recorded[4:]])
    sent = {topic for topic in recorded[4:] if not topic.endswith("/target")}
    wait_until(lambda: _recorded("/ros_pybullet_interface") >= sent, "all topics are recorded")
    assert ros.call("/rpbi/start", Trigger).success
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120.0)
    stop_group(recorder)
    command = identify.replace("./rpbi", RPBI).replace("src/", f"{ROOT}/src/")
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, text=True, timeout=500.0)
    assert done.returncode == 0, done.stderr
    results = "\n".join(line for line in done.stdout.splitlines() if not line.startswith("out/"))
    assert agree(shown, results, varies=True), results
    found = json.loads((tmp_path / "out/identify/report.json").read_text())["parameters"]
    found = {name: each["value"] for name, each in found.items()}
    assert found["friction"] == pytest.approx(0.42, rel=0.01) and found["mass"] == pytest.approx(0.85, rel=0.01)
    assert found["gain"] == pytest.approx(0.07, rel=0.01) and 0.0 <= found["delay"] <= STEP_S
