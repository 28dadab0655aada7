"""The master of the tests ends nodes whose name somebody takes, but nobody else's."""

from __future__ import annotations

import subprocess
import sys

import rosgraph
from ros_system import wait_until
from second_master import SecondMaster

NODE = """
import sys, rospy
rospy.init_node(sys.argv[1])
print("up at", rospy.get_node_uri(), flush=True)
rospy.spin()
"""


def start(ros, name: str, **environment: str) -> subprocess.Popen:
    process = ros.start([sys.executable, "-c", NODE, name], **environment)
    wait_until(lambda: "up at" in ros.output(process), "the node is up")
    return process


def test_a_node_whose_name_is_taken_ends_and_one_of_another_master_at_its_address_does_not(ros):
    first = start(ros, "twin")
    second = start(ros, "twin")
    assert first.wait(60.0) == 0
    other_master = SecondMaster(ros)
    stranger = start(ros, "stranger", **other_master.environment)
    address = ros.output(stranger).split("up at ")[1].split()[0]
    ours = rosgraph.Master("/gone")
    ours.registerPublisher("/something", "std_msgs/String", address)
    ours.registerPublisher("/something", "std_msgs/String", "http://127.0.0.1:1/")
    third = start(ros, "twin")
    assert second.wait(60.0) == 0, "the master has come to this since"
    assert stranger.poll() is None and third.poll() is None
    other_master.kill()
