"""Converts serialised messages between ROS 1 and CDR, the serialisation of ROS 2, by a plan for each type.

ROS 1 packs values without padding. CDR aligns each number to its size, and ends strings with a zero byte.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from typing import NamedTuple

from rpbi_data.bags.message_layout import NUMBER_DTYPES, SCALAR, VARIABLE

from .layouts import Ros2Field, Ros2Type

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""First bytes of a message in CDR: plain CDR, little-endian."""
MAX_BYTES = 1 << 28
"""Largest size of a message [bytes]."""
_PARTS = {name: (dtype.itemsize, 1) for name, dtype in NUMBER_DTYPES.items()} | {"time": (4, 2), "duration": (4, 2)}
"""Size and number of the numbers that a value of a primitive type consists of."""
_LENGTH = struct.Struct("<I")


class MessageSource:
    """Reads values of a serialised message.

    Args:
        data: The message, without a header.
        is_cdr: Whether it is in CDR, otherwise as in ROS 1.
    """

    def __init__(self, data: memoryview, is_cdr: bool) -> None:
        self._data, self._at, self.is_cdr = data, 0, is_cdr

    @property
    def left(self) -> int:
        """Number of bytes that are left."""
        return len(self._data) - self._at

    def take(self, size: int, count: int) -> memoryview:
        """Reads numbers of one size [bytes].

        Raises:
            ValueError: If the message is too short.
        """
        at = self._at
        if self.is_cdr and count:
            at += -at % size
        end = at + size * count
        if end > len(self._data):
            raise ValueError(f"it ends after {len(self._data)} bytes, before a value is complete")
        self._at = end
        return self._data[at:end]

    def length(self) -> int:
        """Reads the number of elements of an array, each of which has at least one byte.

        Raises:
            ValueError: If the message is too short.
        """
        (length,) = _LENGTH.unpack(self.take(4, 1))
        if length > self.left:
            raise ValueError(f"a length of {length} with {self.left} bytes left")
        return int(length)

    def string(self) -> memoryview:
        """Reads a string, without its zero byte.

        Raises:
            ValueError: If the message is too short, or the string has no zero byte in CDR.
        """
        text = self.take(1, self.length())
        if not self.is_cdr:
            return text
        if text and text[-1] != 0:
            raise ValueError("a string does not end with a zero byte")
        return text[:-1]


class MessageSink:
    """Writes values of a message.

    Args:
        is_cdr: Whether to write CDR, with its first bytes; otherwise as in ROS 1.
    """

    def __init__(self, is_cdr: bool) -> None:
        self._parts: list[bytes | memoryview] = [LITTLE_ENDIAN] if is_cdr else []
        self._at, self.is_cdr = 0, is_cdr

    def put(self, data: bytes | memoryview, size: int) -> None:
        """Writes numbers of one size [bytes]."""
        if self.is_cdr and (gap := -self._at % size) and data:
            self._parts.append(bytes(gap))
            self._at += gap
        self._parts.append(data)
        self._at += len(data)

    def length(self, length: int) -> None:
        """Writes the number of elements of an array."""
        self.put(_LENGTH.pack(length), 4)

    def string(self, text: bytes | memoryview) -> None:
        """Writes a string; for CDR, with a zero byte."""
        self.length(len(text) + self.is_cdr)
        self.put(text, 1)
        if self.is_cdr:
            self.put(b"\0", 1)

    @property
    def data(self) -> bytes:
        """The message; in CDR, its length is a multiple of 4."""
        if self.is_cdr:
            self.put(bytes(-self._at % 4), 1)
        return b"".join(self._parts)


class _Step(ABC):
    """One step of a plan, which moves a value from a source to a sink."""

    @abstractmethod
    def move(self, source: MessageSource, sink: MessageSink) -> None:
        """Moves the value."""

    @abstractmethod
    def put_default(self, sink: MessageSink) -> None:
        """Writes zeros, empty strings and empty arrays."""


class _Numbers(_Step):
    def __init__(self, size: int, count: int) -> None:
        self.size, self.count = size, count

    def move(self, source: MessageSource, sink: MessageSink) -> None:
        sink.put(source.take(self.size, self.count), self.size)

    def put_default(self, sink: MessageSink) -> None:
        sink.put(bytes(self.size * self.count), self.size)


class _String(_Step):
    def move(self, source: MessageSource, sink: MessageSink) -> None:
        sink.string(source.string())

    def put_default(self, sink: MessageSink) -> None:
        sink.string(b"")


class _Message(_Step):
    def __init__(self, steps: tuple[_Step, ...]) -> None:
        self.steps = steps

    def move(self, source: MessageSource, sink: MessageSink) -> None:
        for step in self.steps:
            step.move(source, sink)

    def put_default(self, sink: MessageSink) -> None:
        for step in self.steps:
            step.put_default(sink)


class _Array(_Step):
    """An array; numbers, and messages that consist of numbers of one size, are moved as one block."""

    def __init__(self, element: _Step, length: int) -> None:
        self.element, self.fixed = element, None if length == VARIABLE else length

    def move(self, source: MessageSource, sink: MessageSink) -> None:
        count = self.fixed
        if count is None:
            count = source.length()
            sink.length(count)
        element = self.element
        if isinstance(element, _Numbers):
            sink.put(source.take(element.size, element.count * count), element.size)
            return
        for _ in range(count):
            element.move(source, sink)

    def put_default(self, sink: MessageSink) -> None:
        if self.fixed is None:
            sink.length(0)
        for _ in range(self.fixed or 0):
            self.element.put_default(sink)


class _Only(_Step):
    """A value that only ROS 1 or only ROS 2 has."""

    def __init__(self, step: _Step, is_cdr: bool) -> None:
        self.step, self.is_cdr = step, is_cdr

    def move(self, source: MessageSource, sink: MessageSink) -> None:
        if source.is_cdr == self.is_cdr:
            self.step.move(source, MessageSink(sink.is_cdr))
        else:
            self.step.put_default(sink)

    def put_default(self, sink: MessageSink) -> None:
        if sink.is_cdr == self.is_cdr:
            self.step.put_default(sink)


class Converter(NamedTuple):
    """Converts messages of one type."""

    type_name: str
    plan: _Step

    @classmethod
    def of(cls, message_type: Ros2Type) -> Converter:
        """Makes the converter of a type."""
        return cls(message_type.name, _plan(message_type))

    def to_cdr(self, data: bytes) -> bytes:
        """Converts a message of ROS 1 to CDR.

        Raises:
            ValueError: If the message does not fit its type.
        """
        return self._converted(MessageSource(memoryview(data), is_cdr=False))

    def from_cdr(self, data: bytes) -> bytes:
        """Converts a message in CDR to ROS 1. Fields that only ROS 1 has are zero.

        Raises:
            ValueError: If the message is no plain little-endian CDR, or does not fit its type.
        """
        if data[:2] != LITTLE_ENDIAN[:2]:
            raise ValueError(f"expected plain little-endian CDR, got a message that begins with {data[:4].hex(' ')}")
        return self._converted(MessageSource(memoryview(data)[4:], is_cdr=True))

    def _converted(self, source: MessageSource) -> bytes:
        if source.left > MAX_BYTES:
            raise ValueError(f"{source.left:,} bytes: expected at most {MAX_BYTES:,}")
        sink = MessageSink(not source.is_cdr)
        self.plan.move(source, sink)
        if source.left > 3 * source.is_cdr:  # padding
            raise ValueError(f"{source.left} bytes are left after a {self.type_name}")
        return sink.data


def _plan(message_type: Ros2Type) -> _Step:
    steps: list[_Step] = []
    for field in message_type.fields:
        step = _step_of(field)
        last = steps[-1] if steps else None
        if isinstance(step, _Numbers) and isinstance(last, _Numbers) and step.size == last.size:
            steps[-1] = _Numbers(step.size, last.count + step.count)
        else:
            steps.append(step)
    return steps[0] if len(steps) == 1 else _Message(tuple(steps))


def _step_of(field: Ros2Field) -> _Step:
    step: _Step
    if isinstance(field.type, Ros2Type):
        step = _plan(field.type)
    elif field.type == "string":
        step = _String()
    else:
        step = _Numbers(*_PARTS[field.type])
    if field.length != SCALAR:
        is_block = isinstance(step, _Numbers) and field.length != VARIABLE
        step = _Numbers(step.size, step.count * field.length) if is_block else _Array(step, field.length)  # type: ignore[attr-defined]
    return _Only(step, is_cdr=field.only == 2) if field.only else step
