"""A node whose master ends while it starts; its argument is the master's process."""

import os
import signal
import sys

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is

import rospy  # noqa: E402

from custom_ros_tools.ros.lifecycle.run_node import run_node  # noqa: E402


def _start() -> None:
    os.kill(int(sys.argv[1]), signal.SIGKILL)
    while True:
        rospy.get_param("anything", None)


run_node("loser", _start)
