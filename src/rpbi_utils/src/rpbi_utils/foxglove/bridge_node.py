"""The bridge between a ROS system and viewers that speak the Foxglove protocol."""

from __future__ import annotations

import struct
import time
from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.wall_time import WallTimer

from .called_services import CalledServices
from .parameter_services import MasterParameters, read_parameter
from .sent_topics import SentTopics
from .shown_topics import ShownTopics
from .viewer_server import TIME_HZ, Viewers

LOOK_HZ = 1.0
"""Rate at which topics and services are compared with those of the master [Hz]."""
SIMULATED_TIME = "/use_sim_time"
CLOCK = struct.Struct("<II")
"""Bytes of rosgraph_msgs/Clock: seconds and nanoseconds."""


class FoxgloveNode:
    """Serves topics, services, parameters and time of a ROS system to viewers.

    Args:
        host: Address of this computer at which the server listens.
        port: Port.

    Raises:
        PortError: If the server cannot listen at the address.
    """

    def __init__(self, host: str, port: int) -> None:
        self._clock = RosClock()
        self._viewers = Viewers(host, port)
        self.shown = ShownTopics(self._viewers, self._clock.now_ns)
        self.sent = SentTopics()
        self.services = CalledServices(self._viewers)
        self.parameters = MasterParameters()
        port = self._viewers.start(_Listener(self))
        rospy.on_shutdown(self._viewers.stop)
        WallTimer(LOOK_HZ, self._look)
        WallTimer(TIME_HZ, self._send_time)
        rospy.loginfo("Foxglove and Lichtblick can connect to ws://%s:%d", host, port)

    def _look(self) -> None:
        self._clock.is_simulated = bool(read_parameter(SIMULATED_TIME))
        self.shown.look()
        self.services.update(self.shown.table.state.providers)

    def _send_time(self) -> None:
        self._clock.follow(self.shown.has_viewers)
        now_ns = self._clock.now_ns()
        if now_ns:
            self._viewers.send_time(now_ns)


class RosClock:
    """ROS time: the time on `/clock` if the system has simulated time, otherwise the time of this computer.

    `/clock` is subscribed to only while a viewer wants any topic.

    Attributes:
        is_simulated: Whether the system has simulated time.
    """

    def __init__(self) -> None:
        self.is_simulated = False
        self._subscriber: rospy.Subscriber | None = None
        self._simulated_ns = 0

    def now_ns(self) -> int:
        """Returns the time [ns]; 0 for simulated time that is not known."""
        return self._simulated_ns if self.is_simulated else time.time_ns()

    def follow(self, is_wanted: bool) -> None:
        """Subscribes to `/clock` if it is wanted and the system has simulated time; otherwise unsubscribes."""
        if is_wanted and self.is_simulated:
            if self._subscriber is None:
                self._subscriber = rospy.Subscriber("/clock", rospy.AnyMsg, self._on_message, tcp_nodelay=True)
        elif self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber, self._simulated_ns = None, 0

    def _on_message(self, message: Any) -> None:
        if len(message._buff) == CLOCK.size:
            seconds, nanoseconds = CLOCK.unpack(message._buff)
            self._simulated_ns = seconds * 1_000_000_000 + nanoseconds


class _Listener:
    """Passes calls of foxglove-sdk on to the parts of the node. The calls come from threads of the server."""

    def __init__(self, node: FoxgloveNode) -> None:
        self._node = node

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._node.shown.subscribe(client.id, channel.id)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        self._node.shown.unsubscribe(client.id, channel.id)

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        self._node.sent.advertise(client.id, channel)

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        self._node.sent.unadvertise(client.id, client_channel_id)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        self._node.sent.send(client.id, client_channel_id, data)

    def on_get_parameters(self, client: Any, param_names: list[str], request_id: str | None = None) -> list[Any]:
        return self._node.parameters.get(client.id, param_names)

    def on_set_parameters(self, client: Any, parameters: list[Any], request_id: str | None = None) -> list[Any]:
        return self._node.parameters.set(client.id, parameters)

    def on_parameters_subscribe(self, param_names: list[str]) -> None:
        """Ignored, see `viewer_server.CAPABILITIES`."""

    def on_parameters_unsubscribe(self, param_names: list[str]) -> None:
        """Ignored."""
