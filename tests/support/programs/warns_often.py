"""A node with a timer that publishes a message and then logs a warning, again and again."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is

import rospy  # noqa: E402
from std_msgs.msg import Empty  # noqa: E402

from custom_ros_tools.ros.lifecycle.run_node import run_node  # noqa: E402
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer  # noqa: E402


def _start() -> object:
    beats = rospy.Publisher("beats", Empty, queue_size=10)

    def beat() -> None:
        beats.publish()
        rospy.logwarn("a beat")

    return WallTimer(50.0, beat)


run_node("warns_often", _start)
