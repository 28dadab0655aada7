"""A node that still publishes while ROS shuts down, after its topic has been closed."""

import signal
import time

signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # before any thread is

import rospy  # noqa: E402
from std_msgs.msg import Empty  # noqa: E402

from custom_ros_tools.ros.lifecycle.run_node import run_node  # noqa: E402


def _start() -> rospy.Publisher:
    beats = rospy.Publisher("beats", Empty, queue_size=1)
    rospy.on_shutdown(lambda: (beats.unregister(), time.sleep(1.0)))
    return beats


def _run(beats: rospy.Publisher) -> None:
    while not rospy.is_shutdown():
        beats.publish()
        time.sleep(0.01)


run_node("publishes_to_its_end", _start, _run)
