"""`sampling_mpc.launch`, from its start until the arm has brought the box to its mark."""

from __future__ import annotations

import math

import pytest
import rospy
from ros_system import wait_until
from std_srvs.srv import Trigger

from rpbi_examples.costs import GOAL
from rpbi_mpc.msg import MpcStatus

pytestmark = pytest.mark.thorough


def test_the_arm_brings_the_box_to_its_mark(ros):
    launched = ros.start(
        ["roslaunch", "rpbi_examples", "sampling_mpc.launch", "headless:=true", "start_on_init:=false"]
    )
    status, frames = ros.listen("mpc/status", MpcStatus), ros.listen_to_tf()
    assert ros.call("mpc/step", Trigger).message == "cycle 0: solved"

    def distance() -> float:
        place = frames.lookup_transform("rpbi/world", "rpbi/box", rospy.Time(0)).transform.translation
        return math.hypot(place.x - GOAL[0], place.y - GOAL[1])

    wait_until(lambda: frames.can_transform("rpbi/world", "rpbi/box", rospy.Time(0)), "there is a box")
    assert distance() > 0.25
    assert ros.call("mpc/start", Trigger).success
    wait_until(lambda: distance() < 0.1, "the box is near its mark")
    others = [each for each in status.messages if each.status not in ("ready", "solved")]
    assert not others, f"{others}\n{ros.output(launched)}"
    assert ros.call("mpc/stop", Trigger).success
