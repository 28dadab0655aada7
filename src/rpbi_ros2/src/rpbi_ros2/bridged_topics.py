"""All topics that the bridge connects, as they appear and disappear in ROS 1."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, timed_master
from custom_ros_tools.ros.topic_table import UNKNOWN_TYPE, TopicRow, TopicTable

from .config import NEVER_IN, NEVER_OUT, BridgeConfig
from .dds import DdsParticipant, DdsWriter
from .layouts import OWN_PACKAGES, RefusedTypeError
from .routed_topics import STATIC_TF, IncomingTopic, MessageKind, OutgoingStaticTf, OutgoingTopic, text_message

TEXT = "std_msgs/String"
DESCRIPTION = "robot_description"
"""Last part of the names of parameters with URDFs, each of which is a topic in ROS 2."""
SHARED = frozenset({"/tf", "/tf_static", "/diagnostics"})
"""Topics that several programs publish."""
STREAMS = frozenset(
    "geometry_msgs/PoseStamped geometry_msgs/Twist geometry_msgs/WrenchStamped nav_msgs/Odometry rosgraph_msgs/Clock "
    "ros_pybullet_interface/Contacts sensor_msgs/CameraInfo sensor_msgs/CompressedImage sensor_msgs/Image "
    "sensor_msgs/Imu sensor_msgs/JointState sensor_msgs/LaserScan sensor_msgs/PointCloud2 tf2_msgs/TFMessage".split()
)
"""Types of sensor data. Topics of other types keep their last message for readers that come later."""


class BridgedTopics:
    """All connected topics.

    Args:
        config: The parameters.
        participant: The participant in the domain of ROS 2.
        table: The table of topics in ROS 1.
    """

    def __init__(self, config: BridgeConfig, participant: DdsParticipant, table: TopicTable) -> None:
        self._config, self._participant, self._table = config, participant, table
        self._packages = OWN_PACKAGES | frozenset(config.packages.split())
        self._kinds: dict[str, MessageKind | str] = {}
        self._outgoing: dict[str, OutgoingTopic] = {}
        self._incoming: dict[str, IncomingTopic] = {}
        self._descriptions: dict[str, tuple[DdsWriter, str]] = {}
        self._collisions: set[str] = set()

    @property
    def is_holding(self) -> bool:
        """Whether messages of ROS 2 wait until a subscriber in ROS 1 is connected."""
        return any(topic.is_holding for topic in self._incoming.values())

    def forward(self) -> None:
        """Publishes messages of ROS 2 in ROS 1."""
        for topic in self._incoming.values():
            topic.forward()

    def update(self) -> None:
        """Subscribes in ROS 1 where readers of ROS 2 have come, and unsubscribes where they have gone."""
        for outgoing in self._outgoing.values():
            outgoing.update()
        for incoming in self._incoming.values():
            incoming.update()

    def synchronise(self) -> None:
        """Opens and closes topics, as they appear and disappear in ROS 1."""
        us, state, known = {rospy.get_name()}, self._table.state, set(self._kinds)
        rows = {name: row for name, row in self._table.rows.items() if row.publishers - us}
        published = self._kinds_of(((name, row.type) for name, row in rows.items()), NEVER_OUT)
        listening = (name for name, nodes in state.subscribers.items() if nodes - us)
        subscribed = self._kinds_of(((name, state.types.get(name, UNKNOWN_TYPE)) for name in listening), NEVER_IN)
        for topics, kinds in ((self._outgoing, published), (self._incoming, subscribed)):
            for name in [name for name, topic in topics.items() if kinds.get(name) is not topic.kind]:
                topics.pop(name).close()
        for name, kind in published.items():
            self._publish(rows[name], kind)
        for name, kind in subscribed.items():
            if name not in self._incoming:
                reader = self._participant.reader(self._config.ros2_name(name), kind.ros2_type)
                self._incoming[name] = IncomingTopic(name, kind, reader)
        refused = {kind for name, kind in self._kinds.items() if isinstance(kind, str) and name not in known}
        if refused:
            rospy.loginfo(f"not connected with ROS 2: {'; '.join(sorted(refused))}")
        self._report_collisions()

    def describe(self) -> None:
        """Publishes the URDFs among the parameters of ROS 1 as texts, each on a topic with the parameter's name."""
        kind = self.kind(TEXT)
        for name, urdf in _descriptions(self._config):
            writer, before = self._descriptions.get(name, (None, None))
            if urdf == before or name in self._outgoing:
                continue
            writer = writer or self._participant.writer(self._config.ros2_name(name), kind.ros2_type, keeps_last=True)
            writer.write(kind.converter.to_cdr(text_message(urdf)))
            self._descriptions[name] = writer, urdf

    def kind(self, type_name: str) -> MessageKind:
        """Returns a type of messages.

        Raises:
            RefusedTypeError: If ROS 2 has no such type.
        """
        if type_name not in self._kinds:
            try:
                self._kinds[type_name] = MessageKind(type_name, self._packages)
            except RefusedTypeError as error:
                self._kinds[type_name] = str(error)
        kind = self._kinds[type_name]
        if isinstance(kind, str):
            raise RefusedTypeError(kind)
        return kind

    def _kinds_of(self, topics: Iterable[tuple[str, str]], never: frozenset[str]) -> dict[str, MessageKind]:
        """Returns the types of those topics, given as names and types, that are connected."""
        kinds = {}
        for name, type_name in topics:
            if name not in never and type_name != UNKNOWN_TYPE and self._config.connects(name):
                with contextlib.suppress(RefusedTypeError):
                    kinds[name] = self.kind(type_name)
        return kinds

    def _publish(self, row: TopicRow, kind: MessageKind) -> None:
        """Opens a topic for ROS 2; opens it anew if only now it is known that it is latched."""
        keeps_last = bool(row.is_latched) or row.name == STATIC_TF or row.type not in STREAMS
        topic = self._outgoing.get(row.name)
        if topic is not None and topic.writer.keeps_last < keeps_last:
            topic.close()
            topic = None
        if topic is None:
            writer = self._participant.writer(self._config.ros2_name(row.name), kind.ros2_type, keeps_last)
            outgoing = OutgoingStaticTf if row.name == STATIC_TF else OutgoingTopic
            topic = self._outgoing[row.name] = outgoing(row.name, kind, writer, self._table.learn)
        topic.is_latched |= bool(row.is_latched)

    def _report_collisions(self) -> None:
        """Warns of topics that others publish in ROS 2, and nobody reads in ROS 1."""
        ours = {self._config.ros2_name(name) for name in self._outgoing.keys() - self._incoming.keys() - SHARED}
        new = sorted((ours & self._participant.topics_of_others()) - self._collisions)
        if new:
            self._collisions |= {*new}
            where = f"domain {self._participant.domain_id} of ROS 2"
            rospy.logwarn(
                f"{where} has other publishers of {', '.join(new)}: is it the domain of another robot? "
                "~domain_id and ~prefix separate them"
            )


def _descriptions(config: BridgeConfig) -> list[tuple[str, str]]:
    """Returns names and values of the parameters with URDFs."""
    found: list[tuple[str, Any]] = []
    with contextlib.suppress(*MASTER_FAILURES), timed_master() as master:
        names = master.getParamNames(rospy.get_name())[2]
        named = [name for name in names if name.rpartition("/")[2] == DESCRIPTION and config.connects(name)]
        found = [(name, master.getParam(rospy.get_name(), name)[2]) for name in named]
    return [(name, urdf) for name, urdf in found if isinstance(urdf, str)]
