"""Parses message definitions, which every bag contains, and finds the location of each value in a message.

Generated message classes are not needed. If the strings and arrays of two messages of one type have the same lengths,
all values have the same offsets. Thousands of messages can therefore be read like one array.

Messages are serialised as in ROS 1: little-endian values without padding. Strings and variable-length arrays are
preceded by their length as uint32. `time` and `duration` are two 32-bit integers.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import shortened

from .limits import MAX_DEFINITION_BYTES, MAX_DEPTH, MAX_NAME_BYTES, MAX_VALUES, LimitError

SCALAR = -1
VARIABLE = -2

BYTE_TYPES = ("uint8", "char")
PRIMITIVE_TYPES = frozenset(
    "bool byte char int8 int16 int32 int64 uint8 uint16 uint32 uint64 float32 float64 string time duration".split()
)
_HEADER = (("seq", "uint32", SCALAR), ("stamp", "time", SCALAR), ("frame_id", "string", SCALAR))
_SEPARATOR = "=" * 80  # between the definitions of a type and of the types in it
_FIELD = re.compile(r"([a-zA-Z][\w/]*)(?:\[(\d{0,10})\])?\s+([a-zA-Z]\w*)", re.ASCII)


class Field(NamedTuple):
    """One field of a message.

    Attributes:
        name: Name of the field.
        type: Name of a primitive type (`float64`, `string`, `time`, ...), or a message type.
        length: Number of elements of a fixed-length array; `VARIABLE` for other arrays, `SCALAR` for single values.
    """

    name: str
    type: str | MessageType
    length: int = SCALAR


@dataclass(eq=False)
class MessageType:
    """A message type, including the types of its fields.

    Attributes:
        name: Full name, such as `sensor_msgs/JointState`.
        fields: Fields in the order of serialisation. Fields without bytes are left out: messages without fields,
            fixed-length arrays of such messages, and arrays of length 0.
        holds_bytes: Whether the type contains a variable-length byte array (`uint8[]`), like images and point clouds.
    """

    name: str
    fields: tuple[Field, ...]
    holds_bytes: bool

    @classmethod
    def parse(cls, name: str, definition: str) -> MessageType:
        """Parses a message definition from a bag.

        The definition is the text of the type, then a section `MSG: package/Type` for each type of a nested message.
        The processing time is proportional to the length of the definition.

        Raises:
            LimitError: If the definition is too long, or types are nested too deeply.
            ValueError: If the text is not a valid definition.
        """
        try:
            if len(definition) > MAX_DEFINITION_BYTES:
                raise LimitError.over(f"{MAX_DEFINITION_BYTES:,} bytes", f"{len(definition):,}")
            return _Builder(dict(_split(name, definition))).build(name)
        except ValueError as error:
            raise type(error)(f"definition of {shortened(name)} cannot be read: {error}") from error

    @property
    def has_header(self) -> bool:
        """Whether the first field is a `std_msgs/Header`, so that messages have a stamp."""
        first, length = self.fields[0][1:] if self.fields else ("", SCALAR)
        is_header = isinstance(first, MessageType) and first.name == "std_msgs/Header" and first.fields == _HEADER
        return is_header and length == SCALAR


class _Builder:
    """Builds the message types of a definition. Each type is built only once.

    Args:
        declared: Name, type name and length of each field, indexed by the name of the message type.
    """

    def __init__(self, declared: dict[str, list[tuple[str, str, int]]]) -> None:
        self._declared = declared
        self._built: dict[str, MessageType | None] = {}

    def build(self, name: str, depth: int = 1) -> MessageType:
        if depth > MAX_DEPTH:
            raise LimitError.over(f"{MAX_DEPTH} levels of types within types", "more")
        if name not in self._built:
            self._built[name] = None
            self._built[name] = self._make(name, depth)
        built = self._built[name]
        if built is None:
            raise ValueError(f"{shortened(name)} contains itself")
        return built

    def _make(self, name: str, depth: int) -> MessageType:
        fields, holds_bytes = [], False
        if name not in self._declared:
            raise ValueError(f"type {shortened(name)} is not in it")
        for field, type_name, length in self._declared[name]:
            field_type = type_name if type_name in PRIMITIVE_TYPES else self.build(type_name, depth + 1)
            is_empty = isinstance(field_type, MessageType) and not field_type.fields
            if length == 0 or (is_empty and length != VARIABLE):
                continue
            fields.append(Field(field, field_type, length))
            holds_bytes |= (
                field_type.holds_bytes
                if isinstance(field_type, MessageType)
                else field_type in BYTE_TYPES and length == VARIABLE
            )
        return MessageType(name, tuple(fields), holds_bytes)


def _split(name: str, definition: str) -> Iterator[tuple[str, list[tuple[str, str, int]]]]:
    """Yields the name and the declared fields of each type in a full definition."""
    sections = definition.split(_SEPARATOR)
    yield name, list(_fields(name, sections[0]))
    for section in sections[1:]:
        title, _, text = section.strip().partition("\n")
        if not title.startswith("MSG:"):
            raise ValueError(f"expected 'MSG: package/Type', got '{shortened(title)}'")
        type_name = title.removeprefix("MSG:").strip()
        yield type_name, list(_fields(type_name, text))


def _fields(type_name: str, text: str) -> Iterator[tuple[str, str, int]]:
    """Yields name, type and length of each field that a text declares; constants are skipped."""
    package = type_name.partition("/")[0]
    seen = set()
    for line in text.split("\n"):
        declaration = line.partition("#")[0].strip()
        if not declaration or "=" in declaration:
            continue
        match = _FIELD.fullmatch(declaration)
        if match is None:
            raise ValueError(f"expected 'type name', got '{shortened(declaration)}'")
        base, length, name = match.groups()
        if name in seen:
            raise ValueError(f"two fields of {shortened(type_name)} are called '{shortened(name)}'")
        seen.add(name)
        if base == "Header":
            base = "std_msgs/Header"
        elif base not in PRIMITIVE_TYPES and "/" not in base:
            base = f"{package}/{base}"
        yield name, base, SCALAR if length is None else VARIABLE if length == "" else int(length)


MAX_ARRAY_COLUMNS = 1000
BYTES = "bytes"
NUMBER_DTYPES: dict[str, np.dtype[Any]] = {
    "bool": np.dtype("u1"), "char": np.dtype("u1"), "byte": np.dtype("i1"),
    "int8": np.dtype("i1"), "int16": np.dtype("<i2"), "int32": np.dtype("<i4"), "int64": np.dtype("<i8"),
    "uint8": np.dtype("u1"), "uint16": np.dtype("<u2"), "uint32": np.dtype("<u4"), "uint64": np.dtype("<u8"),
    "float32": np.dtype("<f4"), "float64": np.dtype("<f8"),
}  # fmt: skip
_SIZES = {name: dtype.itemsize for name, dtype in NUMBER_DTYPES.items()} | {"time": 8, "duration": 8}


class Leaf(NamedTuple):
    """Location of one value in a serialised message.

    Attributes:
        kind: A primitive type, or `BYTES` for an array that is kept whole.
        start: Offset of the value's first byte; for a string, of the first character.
        size: Number of bytes of the value.
    """

    kind: str
    start: int
    size: int

    @property
    def span(self) -> tuple[int, int]:
        """Offsets of the value's first byte, and of the first byte after the value."""
        return self.start, self.start + self.size

    def text(self, raw: bytes) -> str:
        """Returns the string at the location of this value in a serialised message."""
        return raw[self.start : self.start + self.size].decode("utf-8", "replace")


class Layout(NamedTuple):
    """Locations of all values in a serialised message.

    Attributes:
        leaves: Location of each value, indexed by path, such as `pose/position/x` or `data/3`.
        counts: Number of elements of each array, indexed by path.
        fixed: Spans of bytes that contain lengths. The layout is valid for all messages with the same bytes there.
    """

    leaves: dict[str, Leaf]
    counts: dict[str, int]
    fixed: list[tuple[int, int]]


def lay_out(message_type: MessageType, raw: bytes) -> Layout:
    """Finds the locations of all values in a serialised message.

    Each element of an array has a location, with the path `data/0`, `data/1`, ... Variable-length byte arrays, and
    arrays of more than `MAX_ARRAY_COLUMNS` numbers, have one location of the kind `BYTES`.

    Raises:
        LimitError: If the message has too many values, or a value's path is too long.
        ValueError: If the message does not fit its type.
    """
    cursor = _Cursor(raw)
    cursor.read_message(message_type, "")
    if cursor.at != len(raw):
        raise ValueError(f"{len(raw)} bytes, of which {message_type.name} takes {cursor.at}")
    return cursor.layout


class _Cursor:
    """Reads the layout of one message, field by field."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw
        self.at = 0
        self.layout = Layout({}, {}, [])

    def read_message(self, message_type: MessageType, prefix: str) -> None:
        for field in message_type.fields:
            path = prefix + field.name
            if field.length == SCALAR:
                self._read_value(field.type, path)
            else:
                self._read_array(field.type, path, field.length)

    def _read_array(self, element: str | MessageType, path: str, length: int) -> None:
        count = self.layout.counts[path] = self._read_length() if length == VARIABLE else length
        if element in NUMBER_DTYPES:
            is_binary = element in BYTE_TYPES and length == VARIABLE
            if is_binary or count > MAX_ARRAY_COLUMNS:
                self._add_leaf(path, BYTES, count * _SIZES[str(element)])
                return
        if isinstance(element, MessageType) and not element.fields:
            return
        for index in range(count):
            self._read_value(element, f"{path}/{index}")

    def _read_value(self, value_type: str | MessageType, path: str) -> None:
        if isinstance(value_type, MessageType):
            self.read_message(value_type, path + "/")
        elif value_type == "string":
            self._add_leaf(path, "string", self._read_length())
        else:
            self._add_leaf(path, value_type, _SIZES[value_type])

    def _read_length(self) -> int:
        start = self.at
        self._advance(4)
        self.layout.fixed.append((start, self.at))
        (length,) = struct.unpack_from("<I", self.raw, start)
        left = len(self.raw) - self.at
        if length > left:  # each element has at least a byte: limits the loop for a false length
            raise ValueError(f"a length of {length} at byte {start}, with {left} bytes left")
        return int(length)

    def _add_leaf(self, path: str, kind: str, size: int) -> None:
        if len(path) > MAX_NAME_BYTES:
            raise LimitError.over(f"{MAX_NAME_BYTES:,} bytes in a name", f"{len(path):,} in '{shortened(path)}'")
        if len(self.layout.leaves) >= MAX_VALUES:
            raise LimitError.over(f"{MAX_VALUES:,} values in a message", "more")
        self.layout.leaves[path] = Leaf(kind, self.at, size)
        self._advance(size)

    def _advance(self, size: int) -> None:
        self.at += size
        if self.at > len(self.raw):
            raise ValueError(f"it ends after {len(self.raw)} bytes, before a value is complete")
