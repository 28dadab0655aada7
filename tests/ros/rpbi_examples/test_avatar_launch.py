"""`avatar.launch`: from datagrams of a suit to an avatar that walks."""

from __future__ import annotations

import math

import pytest
from ros_system import wait_until
from sensor_msgs.msg import JointState
from workplace import Port


@pytest.mark.thorough
def test_the_avatar_walks(ros, own_tf):
    port = Port()
    ros.start(["roslaunch", "rpbi_examples", "avatar.launch", "headless:=true", f"port:={port.number}"])
    states = ros.listen("rpbi/human/joint_states", JointState)
    bends: list[float] = []

    def walks() -> bool:
        position, _ = own_tf.get_tf("rpbi/world", "rpbi/human/Pelvis")
        if position is None or not states.messages:
            return False
        newest = dict(zip(states.messages[-1].name, states.messages[-1].position))
        bends.append(newest["jRightKnee_roty"])
        return math.hypot(position[0], position[1]) > 0.2 and max(bends) > 0.4

    wait_until(walks, "the pelvis is elsewhere and a knee has bent")
