"""The example that grasps, as a user launches it."""

from __future__ import annotations

import re

import pytest
from node_world import Rosout
from ros_system import RosSystem
from sensor_msgs.msg import JointState

pytestmark = pytest.mark.thorough


@pytest.fixture
def example(ros_master, tmp_path):
    system = RosSystem(tmp_path)
    try:
        rosout = Rosout(system)
        states = system.listen("/rpbi/panda/joint_states", JointState)
        system.start(["roslaunch", "rpbi_examples", "grasp_example.launch", "headless:=true", "real_time_factor:=4"])
        yield rosout, states
    finally:
        system.close()


def test_the_box_is_placed_within_two_millimetres(example):
    rosout, states = example
    rosout.wait_for(["from its place (0.50, 0.20)"], timeout_s=300.0)
    said = rosout.logs("from its place (0.50, 0.20)")[0].msg
    assert float(re.search(r"the box is ([\d.]+) mm", said)[1]) < 2.0
    for state in list(states.messages):
        fingers = [q for name, q in zip(state.name, state.position) if "finger_joint" in name]
        assert abs(fingers[0] - fingers[1]) < 1e-3
