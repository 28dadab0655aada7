"""Definitions of message types, with which a viewer reads messages although it has no ROS packages."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from typing import Any

import roslib.message
import rospkg
import rospy
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, TIMEOUT_S, timed_master

_TYPE_NAME = re.compile(r"([a-zA-Z]\w*)/(?:msg/|srv/)?([a-zA-Z]\w*)", re.ASCII)


@dataclass(frozen=True)
class TypeDefinition:
    """A message type as messages and their publishers describe it.

    Attributes:
        name: Full name, such as `sensor_msgs/JointState`.
        md5sum: Checksum of the definition, by which ROS compares types.
        text: The definition, with those of all types in it, as in a bag.
    """

    name: str
    md5sum: str
    text: str

    @classmethod
    def of(cls, message_class: Any) -> TypeDefinition:
        """Returns the definition of a message class."""
        return cls(message_class._type, message_class._md5sum, message_class._full_text)

    @classmethod
    def in_header(cls, header: Mapping[str, str]) -> TypeDefinition | None:
        """Returns the definition in the header of a connection to a publisher; None if the header has none."""
        name, md5sum, text = (header.get(key, "*") for key in ("type", "md5sum", "message_definition"))
        return None if "*" in (name, md5sum, text) else cls(name, md5sum, text)


def installed_message(name: str) -> Any | None:
    """Returns the class of a message type whose ROS package is installed; otherwise None."""
    return _installed(name, roslib.message.get_message_class)


def installed_service(name: str) -> Any | None:
    """Returns the class of a service type whose ROS package is installed; otherwise None."""
    return _installed(name, roslib.message.get_service_class)


def _installed(name: str, get_class: Any) -> Any | None:
    match = _TYPE_NAME.fullmatch(name)
    if match is None or not _is_ros_package(match[1]):  # other names would import any Python module
        return None
    try:
        return get_class(f"{match[1]}/{match[2]}")
    except Exception:  # the package has not been built, or is of another Python
        return None


@lru_cache(maxsize=1)
def _packages() -> rospkg.RosPack:
    return rospkg.RosPack()


def _is_ros_package(name: str) -> bool:
    try:
        return bool(_packages().get_path(name))
    except rospkg.ResourceNotFound:
        return False


def read_message(message_class: Any, data: bytes) -> Any:
    """Returns the message that consists of these bytes.

    Raises:
        ValueError: If the bytes are no message of the class, or have more or fewer bytes than the message.
    """
    try:
        message = message_class().deserialize(data)
    except Exception as error:  # of genpy, or an error that bytes of another type cause
        raise ValueError(f"expected {message_class._type}: {error}") from None
    if write_message(message) != data:
        raise ValueError(f"expected {message_class._type}, got {len(data)} other bytes")
    return message


def write_message(message: Any) -> bytes:
    """Returns the bytes of a message."""
    written = BytesIO()
    message.serialize(written)
    return written.getvalue()


def ask_publishers(topic: str, nodes: Iterable[str]) -> TypeDefinition | None:
    """Asks the publishers of a topic for its definition, one after the other, without subscribing to the topic.

    Each publisher is connected to as a subscriber would, up to the header, and then left.

    Args:
        topic: Name of the topic.
        nodes: Names of its publishers.

    Returns:
        The first answer; None if no publisher answers.
    """
    for node in sorted(nodes):
        try:
            definition = TypeDefinition.in_header(_header_of(topic, node))
        except (*MASTER_FAILURES, ValueError, TypeError, KeyError, rospy.ROSException):
            continue
        if definition is not None:
            return definition
    return None


def _header_of(topic: str, node: str) -> dict[str, str]:
    caller = rospy.get_name()
    with timed_master() as master:
        uri = master.lookupNode(caller, node)[2]
    with timed_master(uri) as publisher:
        _, host, port = publisher.requestTopic(caller, topic, [["TCPROS"]])[2]
    with socket.create_connection((host, port), TIMEOUT_S) as connection:
        fields = {"callerid": caller, "topic": topic, "type": "*", "md5sum": "*", "tcp_nodelay": "1"}
        write_ros_handshake_header(connection, fields)
        return dict(read_ros_handshake_header(connection, BytesIO(), 1 << 16))
