"""`ros2_bridge_node.py`: connects topics of ROS 1 with ROS 2, and answers requests of its companion there."""

from __future__ import annotations

import sys

import rospy

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallRate
from custom_ros_tools.ros.topic_table import TopicTable

from .bridged_topics import TEXT, BridgedTopics
from .config import BridgeConfig
from .dds import DdsParticipant
from .requests_services import REQUEST, RESPONSE, CompanionRequests
from .routed_topics import text_message, text_of

NODE = "ros2_bridge"
MEET_S = 0.5
"""Time at the start in which other bridges of the domain are found [s]."""
UPDATE_HZ, LOOK_HZ, DESCRIBE_HZ = 20.0, 2.0, 0.5
"""Rates at which readers in ROS 2, topics in ROS 1, and descriptions of robots are looked at [Hz]."""
WAIT_S, HOLDING_WAIT_S = 0.05, 0.005
"""Longest time to wait for messages of ROS 2, without and with messages that wait for ROS 1 [s]."""
SWITCH_S = 0.0005
"""Time after which Python's threads take turns [s]; usually 5 ms, for which a message would wait for an image."""


class Ros2Bridge:
    """The bridge.

    Args:
        config: The parameters.

    Raises:
        InterfaceError: If the network interface or the domain cannot be used.
    """

    def __init__(self, config: BridgeConfig) -> None:
        self._participant = DdsParticipant(config)
        self._participant.meet(MEET_S)
        self._table = TopicTable()
        self._table.watch(LOOK_HZ)
        self._topics = BridgedTopics(config, self._participant, self._table)
        self._text = self._topics.kind(TEXT)
        request, response = (config.ros2_name(rospy.resolve_name(name)) for name in (REQUEST, RESPONSE))
        self._answers = self._participant.writer(response, self._text.ros2_type)
        self._asked = self._participant.reader(request, self._text.ros2_type)
        self._requests = CompanionRequests(self._answer)
        self._warn = ThrottledWarning()
        below = f" below /{config.prefix.strip('/')}" if config.prefix else ""
        rospy.loginfo(f"ROS 2: topics{below} in domain {self._participant.domain_id} on {config.interface}")

    def run(self) -> None:
        """Carries messages until ROS 1 shuts down.

        Raises:
            InterfaceError: If an older bridge has the same topics in the domain.
        """
        update, look, describe = WallRate(UPDATE_HZ), WallRate(LOOK_HZ), WallRate(DESCRIBE_HZ)
        while not rospy.is_shutdown():
            self._participant.wait(HOLDING_WAIT_S if self._topics.is_holding else WAIT_S)
            self._topics.forward()
            self._accept_requests()
            if look.is_due():
                self._participant.check_bridges()
                self._topics.synchronise()
            if describe.is_due():
                self._topics.describe()
            if update.is_due():
                self._topics.update()

    def _accept_requests(self) -> None:
        for cdr in self._asked.take():
            try:
                self._requests.accept(text_of(self._text.converter.from_cdr(cdr)))
            except ValueError as error:
                self._warn("request from ROS 2 refused", str(error))

    def _answer(self, answer: str) -> None:
        self._answers.write(self._text.converter.to_cdr(text_message(answer)))


def _start() -> Ros2Bridge:
    sys.setswitchinterval(SWITCH_S)
    return Ros2Bridge(private_parameters(BridgeConfig))


def main() -> None:
    """Runs the node."""
    run_node(NODE, _start, Ros2Bridge.run, ros_time=False)
