"""Topics that the bridge carries: each between one topic of ROS 1 and one of ROS 2, in one direction."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from io import BytesIO
from typing import Any

import genpy
import rospy
from geometry_msgs.msg import TransformStamped
from roslib.message import get_message_class
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

from .cdr import Converter
from .dds import DdsReader, DdsWriter
from .layouts import RefusedTypeError, Ros2Type, ros2_type

QUEUE_SIZE = 1000
"""Messages that wait in ROS 1, in each direction: 1 s of a topic at 1 kHz."""
BUFFER_BYTES = 1 << 22
"""Bytes that rospy reads at once; images at 30 Hz take much time with the usual 64 KiB."""
MAX_HELD, MAX_HELD_S = 100, 5.0
"""Messages from ROS 2 that are kept until a subscriber in ROS 1 is connected, and for how long [s]: an old command must
not move a robot whose node starts again later."""
STATIC_TF = "/tf_static"
Learn = Callable[[str, Mapping[str, str]], None]


class MessageKind:
    """A message type with its converter.

    Args:
        name: Name of the type in ROS 1.
        packages: Further packages of messages that ROS 2 has.

    Raises:
        RefusedTypeError: If ROS 2 has no such type, or its definition is not installed.
    """

    def __init__(self, name: str, packages: frozenset[str]) -> None:
        try:
            found = get_message_class(name)
        except (ValueError, ImportError) as error:
            raise RefusedTypeError(f"type {name}: {error}") from None
        if found is None:
            raise RefusedTypeError(f"type {name} is not installed here")
        self.message_class: Any = found
        self.ros2_type: Ros2Type = ros2_type(name, found._full_text, packages)
        self.converter = Converter.of(self.ros2_type)

    @property
    def raw_class(self) -> Any:
        """A class of messages that keeps their bytes; ROS 1 compares it as the type itself."""
        attributes = {key: getattr(self.message_class, key) for key in ("_type", "_md5sum", "_full_text")}
        return type(self.message_class.__name__, (rospy.AnyMsg,), {**attributes, "__slots__": ()})


class OutgoingTopic:
    """Sends the messages of a topic of ROS 1 to ROS 2, while someone there reads them.

    Args:
        name: Full name in ROS 1.
        kind: Type of the messages.
        writer: Writer in ROS 2.
        learn: Function that gets the name and the header of the first connection to a publisher.
    """

    def __init__(self, name: str, kind: MessageKind, writer: DdsWriter, learn: Learn) -> None:
        self.name, self.kind, self.writer, self._learn = name, kind, writer, learn
        self.is_latched, self._has_learnt = False, False
        self._warn = ThrottledWarning()
        self._subscriber: rospy.Subscriber | None = None

    def update(self) -> None:
        """Subscribes in ROS 1 if there are readers in ROS 2, or the topic is latched; otherwise unsubscribes."""
        is_wanted = self.is_latched or self.writer.is_matched
        if is_wanted and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self.name,
                self.kind.raw_class,
                self._on_message,
                queue_size=QUEUE_SIZE,
                buff_size=BUFFER_BYTES,
                tcp_nodelay=True,
            )
        elif not is_wanted:
            self._unsubscribe()

    def close(self) -> None:
        """Ends the topic in ROS 2."""
        self._unsubscribe()
        self.writer.close()

    def _unsubscribe(self) -> None:
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None

    def _on_message(self, message: rospy.AnyMsg) -> None:
        header = message._connection_header
        if header["callerid"] == rospy.get_name():
            return
        if not self._has_learnt:
            self._has_learnt = True
            self._learn(self.name, header)
        try:
            self._send(message)
        except ValueError as error:
            self._warn(self.name, f"message not sent to ROS 2: {error}")

    def _send(self, message: rospy.AnyMsg) -> None:
        self.writer.write(self.kind.converter.to_cdr(message._buff))


class OutgoingStaticTf(OutgoingTopic):
    """Sends all static transforms in each message, since ROS 2 keeps the last message of a writer only."""

    def __init__(self, name: str, kind: MessageKind, writer: DdsWriter, learn: Learn) -> None:
        super().__init__(name, kind, writer, learn)
        self.is_latched = True
        self._transforms: dict[str, TransformStamped] = {}

    def _send(self, message: rospy.AnyMsg) -> None:
        try:
            received = TFMessage().deserialize(message._buff)
        except genpy.DeserializationError as error:
            raise ValueError(str(error)) from None
        self._transforms |= {transform.child_frame_id: transform for transform in received.transforms}
        self.writer.write(self.kind.converter.to_cdr(serialized(TFMessage([*self._transforms.values()]))))


def text_message(text: str) -> bytes:
    """Returns a `std_msgs/String` as ROS 1 serialises it."""
    return serialized(String(text))


def text_of(message: bytes) -> bytes:
    """Returns the text of a serialised `std_msgs/String`."""
    return message[4:]


def serialized(message: genpy.Message) -> bytes:
    """Returns a message as ROS 1 serialises it."""
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


class IncomingTopic:
    """Publishes the messages of a topic of ROS 2 in ROS 1. The publisher is opened for the first message.

    Args:
        name: Full name in ROS 1.
        kind: Type of the messages.
        reader: Reader in ROS 2.
    """

    def __init__(self, name: str, kind: MessageKind, reader: DdsReader) -> None:
        self.name, self.kind, self.reader = name, kind, reader
        self._warn = ThrottledWarning()
        self._publisher: rospy.Publisher | None = None
        self._held: deque[tuple[float, rospy.AnyMsg]] = deque(maxlen=MAX_HELD)
        """Messages with the times of their arrival [s]."""
        self._has_refused = False

    @property
    def is_holding(self) -> bool:
        """Whether messages wait until a subscriber in ROS 1 is connected."""
        return bool(self._held)

    def forward(self) -> None:
        """Publishes all messages that have arrived, if a subscriber in ROS 1 is connected; otherwise keeps the last.

        Messages older than `MAX_HELD_S` are dropped.
        """
        for cdr in self.reader.take():
            message = rospy.AnyMsg()
            try:
                message._buff = self.kind.converter.from_cdr(cdr)
            except ValueError as error:
                self._warn(self.name, f"message from ROS 2 refused: {error}")
                continue
            self._held.append((time.monotonic(), message))
        while self._held and time.monotonic() - self._held[0][0] > MAX_HELD_S:
            self._held.popleft()
            self._warn(self.name, f"message from ROS 2 dropped: no subscriber in ROS 1 within {MAX_HELD_S:g} s")
        if not self._held:
            return
        if self._publisher is None:
            self._publisher = rospy.Publisher(
                self.name, self.kind.message_class, queue_size=QUEUE_SIZE, tcp_nodelay=True
            )
        while self._held and self._publisher.get_num_connections():
            self._publisher.publish(self._held.popleft()[1])

    def update(self) -> None:
        """Closes the publisher in ROS 1 if nobody in ROS 2 writes to the topic any more; names refused writers once."""
        if self.reader.is_refused and not self._has_refused:
            self._has_refused = True
            rospy.logwarn(f"{self.name}: a publisher in ROS 2 has best effort, expected reliable: it is not read")
        if self._publisher is not None and not self.reader.is_matched:
            self._unpublish()

    def close(self) -> None:
        """Ends the topic in ROS 2."""
        self._unpublish()
        self.reader.close()

    def _unpublish(self) -> None:
        self._held.clear()
        if self._publisher is not None:
            self._publisher.unregister()
            self._publisher = None
