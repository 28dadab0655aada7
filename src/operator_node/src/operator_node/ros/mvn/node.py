"""`mvn_node.py`: people whom MVN streams, as TF, poses and a joy message."""

import time

import rospy
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from operator_node.device import DeviceError
from operator_node.devices.mvn import Mvn
from operator_node.mvn.receiver import MvnConfig
from operator_node.ros.stamps import stamp
from rpbi.ros.publishers.topics import FastTopic

from .topics import MvnTopics

PERIOD_S = 0.05
RETRY_S = 1.0


class MvnNode:
    """Receives and publishes until ROS shuts down.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._device = Mvn(private_parameters(MvnConfig))
        self._topics = MvnTopics(self._device)
        self._joy = FastTopic("joy", Joy)
        self._warn = ThrottledWarning()

    def run(self) -> None:
        """Does the work of the node."""
        while not rospy.is_shutdown():
            try:
                self._device.open()
                config, port = self._device.receiver.config, self._device.receiver.port
                rospy.loginfo("mvn: listening at %s:%d", config.host, port)
                while not rospy.is_shutdown():
                    self._pass()
            except DeviceError as error:
                self._warn(error.device, f"{error.reason}; trying again")
                time.sleep(RETRY_S)
        self._device.close()

    def _pass(self) -> None:
        reading = self._device.read(PERIOD_S)
        if reading is not None:
            header = Header(stamp=stamp(), frame_id="mvn")
            self._joy.publish(Joy(header, list(reading.axes), list(reading.buttons)))
        self._topics.publish(reading.events if reading is not None else ())


def main() -> None:
    """Runs the node."""
    run_node("mvn", MvnNode, MvnNode.run)
