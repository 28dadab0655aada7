"""Connects the controls window to the running simulator through topics and the ROS master. Does not use Qt."""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import CompressedImage, JointState
from std_msgs.msg import Int64

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, timed_master
from ros_pybullet_interface.msg import SimulationState
from rpbi_utils.console.running_simulator import LIST, RunningSimulator

LOOK_S = 1.0
"""Period of queries of the ROS master [s]."""
MAX_FAILED_LOOKS = 3
"""Number of consecutive failed queries after which all topics and services count as missing.

A single query may fail on a busy machine.
"""
SILENCE_S = 2.5
"""Time without a message on `rpbi/status` and `rpbi/state` after which the simulator counts as stopped [s]."""
IMAGE = "/colour/image/compressed"
"""End of the name of a camera's image topic, after `rpbi/CAMERA`."""


@dataclass(frozen=True)
class SimulatorSnapshot:
    """State of the simulator at one moment.

    Attributes:
        is_alive: Whether the simulator has published recently and offers its services.
        is_running: Whether the world is running; False while it is stopped.
        names: Names of topics and services relative to the simulator's namespace, such as `rpbi/step`.
        topics: Full names of all published topics, in all namespaces.
        objects: Types of the objects and cameras, keyed by name.
        state: Newest message on `rpbi/state`; None before the first message.
        warning: The simulator's warning on /diagnostics; empty without a warning.
    """

    is_alive: bool = False
    is_running: bool = False
    names: frozenset[str] = frozenset()
    topics: frozenset[str] = frozenset()
    objects: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    state: SimulationState | None = None
    warning: str = ""

    def has(self, name: str) -> bool:
        """Returns whether the simulator offers a service or topic of this name."""
        return self.is_alive and name in self.names

    @property
    def robots(self) -> list[str]:
        """Names of all robots in the world."""
        return [name for name in self.objects if self.has(f"rpbi/{name}/robot_info")]

    @property
    def cameras(self) -> list[str]:
        """Sorted names of the cameras that publish images; a name is the part `NAME` of the topics `rpbi/NAME/...`."""
        if not self.is_alive:
            return []
        return sorted(
            name.removeprefix("rpbi/").removesuffix(IMAGE)
            for name in self.names
            if name.startswith("rpbi/") and name.endswith(IMAGE)
        )


class Newest:
    """Keeps the newest message of a selectable topic.

    Args:
        message_type: Message type of the topic.
    """

    def __init__(self, message_type: type) -> None:
        self._type = message_type
        self.wanted = ""
        """Name of the selected topic; empty for no subscription."""
        self.message: Any = None
        self._topic = ""
        self._subscriber: rospy.Subscriber | None = None

    def follow(self) -> None:
        """Replaces the subscription if another topic has been selected. This may block for a while."""
        if self._topic == self.wanted:
            return
        if self._subscriber is not None:
            self._subscriber.unregister()
        self._topic, self.message, self._subscriber = self.wanted, None, None
        if self._topic:
            self._subscriber = rospy.Subscriber(
                self._topic, self._type, self._on_message, self._topic, queue_size=1, tcp_nodelay=True
            )

    def _on_message(self, message: Any, topic: str) -> None:
        if topic == self.wanted:
            self.message = message


class SimulatorLink:
    """Watches the simulator in this node's namespace. The simulator may start and end at any time.

    Attributes:
        joints: Subscription to the joint states of the robot that the window shows.
        image: Subscription to the images of the camera that the window shows.
    """

    def __init__(self) -> None:
        self.joints, self.image = Newest(JointState), Newest(CompressedImage)
        self._namespace = rospy.get_namespace()
        self._heard_s, self._is_running = -SILENCE_S, False
        self._state: SimulationState | None = None
        self._warning = ""
        self._names, self._topics = frozenset[str](), frozenset[str]()
        self._objects: Mapping[str, str] = MappingProxyType({})
        self._served: Any = None
        self._failed_looks = 0
        self._wake = threading.Event()
        rospy.Subscriber("rpbi/status", Int64, self._on_status, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("rpbi/state", SimulationState, self._on_state, queue_size=1)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics)
        threading.Thread(target=self._run, name="link", daemon=True).start()

    def look(self) -> None:
        """Triggers a query of the ROS master and returns at once."""
        self._served = None
        self._wake.set()

    def follow(self, newest: Newest, topic: str) -> None:
        """Selects the topic of `newest`, which is `joints` or `image`, and returns at once."""
        if newest.wanted != topic:
            newest.wanted, newest.message = topic, None
            self._wake.set()

    def snapshot(self) -> SimulatorSnapshot:
        """Returns the simulator's present state."""
        if time.monotonic() - self._heard_s > SILENCE_S or LIST not in self._names:
            return SimulatorSnapshot(topics=self._topics)
        return SimulatorSnapshot(
            True, self._is_running, self._names, self._topics, self._objects, self._state, self._warning
        )

    def _run(self) -> None:
        while not rospy.is_shutdown():
            self._wake.clear()
            try:
                self.joints.follow()
                self.image.follow()
                self._look()
                self._failed_looks = 0
            except MASTER_FAILURES:
                self._failed_looks += 1
                if self._failed_looks >= MAX_FAILED_LOOKS:
                    self._names = frozenset()
            except rospy.ROSException:  # the node is shutting down
                return
            self._wake.wait(LOOK_S)

    def _look(self) -> None:
        with timed_master() as master:
            _, _, (published, _, serving) = master.getSystemState(rospy.get_name())
        self._topics = frozenset(name for name, _ in published)
        services = {name for name, _ in serving}
        names = self._topics | services
        self._names = frozenset(
            name.removeprefix(self._namespace) for name in names if name.startswith(self._namespace)
        )
        served = frozenset(map(_entry, serving)), self._names
        if not self.snapshot().is_alive:
            self._served = None
        elif served != self._served:  # topics or services have changed
            self._served = served
            try:
                self._objects = MappingProxyType(RunningSimulator().objects())
            except InterfaceError:
                self._served = None

    def _on_status(self, message: Int64) -> None:
        self._heard_s, self._is_running = time.monotonic(), bool(message.data)

    def _on_state(self, message: SimulationState) -> None:
        self._heard_s, self._state = time.monotonic(), message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self._namespace}ros_pybullet_interface: simulation":
                self._warning = status.message if status.level != DiagnosticStatus.OK else ""


def _entry(entry: tuple[str, list[str]]) -> tuple[str, tuple[str, ...]]:
    name, nodes = entry
    return name, tuple(nodes)
