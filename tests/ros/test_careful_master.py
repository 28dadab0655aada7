"""The master of the tests ends a node whose name is taken, but no other that has come to its address since."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from ros_system import wait_until
from workplace import Port

NODE = """
import sys, rospy
rospy.init_node(sys.argv[1], xmlrpc_port=int(sys.argv[2]))
print("up at", rospy.get_node_uri(), flush=True)
rospy.spin()
"""


def start(ros, name: str, port: int = 0) -> subprocess.Popen:
    """Returns a node."""
    process = ros.start([sys.executable, "-c", NODE, name, str(port)])
    wait_until(lambda: "up at" in ros.output(process), "the node is up")
    return process


def test_taken_name_ends_only_the_older_node_of_that_name(ros):
    first = start(ros, "twin")
    port = Port()  # one that the kernel gives to nobody else when it is free again
    second = start(ros, "twin", port.number)
    assert first.wait(60.0) == 0
    os.killpg(second.pid, signal.SIGKILL)
    second.wait()
    stranger = start(ros, "stranger", port.number)
    third = start(ros, "twin")
    start(ros, "twin")
    assert third.wait(60.0) == 0, "by then the master has also seen to the second"
    assert stranger.poll() is None
