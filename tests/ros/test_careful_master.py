"""The master of the tests ends a node whose name is taken, but no other that has come to its address since."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from ros_system import wait_until

NODE = """
import sys, rospy
rospy.init_node(sys.argv[1], xmlrpc_port=int(sys.argv[2]))
print("up at", rospy.get_node_uri(), flush=True)
rospy.spin()
"""


def start(ros, name: str, port: int = 0) -> tuple[subprocess.Popen, int]:
    """Returns a node and its port."""
    process = ros.start([sys.executable, "-c", NODE, name, str(port)])
    wait_until(lambda: "up at" in ros.output(process), "the node is up")
    return process, int(ros.output(process).split("up at ")[1].split()[0].rstrip("/").rsplit(":", 1)[1])


def test_a_node_whose_name_is_taken_ends_and_one_that_has_come_to_its_address_does_not(ros):
    first, _ = start(ros, "twin")
    second, port = start(ros, "twin")
    assert first.wait(60.0) == 0
    os.killpg(second.pid, signal.SIGKILL)
    second.wait()
    stranger, _ = start(ros, "stranger", port)
    third, _ = start(ros, "twin")
    start(ros, "twin")
    assert third.wait(60.0) == 0, "by then the master has also seen to the second"
    assert stranger.poll() is None
