"""A node that publishes without looking whether ROS shuts down."""

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is

import rospy  # noqa: E402
from std_msgs.msg import Empty  # noqa: E402

from custom_ros_tools.ros.lifecycle.run_node import run_node  # noqa: E402


def _start() -> rospy.Publisher:
    return rospy.Publisher("beats", Empty, queue_size=1)


def _run(beats: rospy.Publisher) -> None:
    while True:
        beats.publish()


run_node("publishes_to_its_end", _start, _run)
