"""Location of each value in a serialised message.

In messages of one type whose strings and arrays have the same lengths, all values have the same offsets, so that
thousands of messages can be read like one array. Serialisation is ROS 1's: little-endian values without padding;
strings and variable-length arrays are preceded by their length as uint32; `time` and `duration` are two 32-bit
integers.
"""

import struct
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import shortened

from .limits import MAX_NAME_BYTES, MAX_VALUES, LimitError
from .message_type import BYTE_TYPES, SCALAR, VARIABLE, MessageType

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
    """One value of a message.

    Attributes:
        kind: A primitive type, or `BYTES` for an array that is kept whole.
        start: Offset of its first byte; of a string, of its first character.
        size: Number of bytes.
    """

    kind: str
    start: int
    size: int

    @property
    def span(self) -> tuple[int, int]:
        """Offsets of its first byte and of the byte after it."""
        return self.start, self.start + self.size

    def text(self, raw: bytes) -> str:
        """Returns the string at this place of a message."""
        return raw[self.start : self.start + self.size].decode("utf-8", "replace")


class Layout(NamedTuple):
    """Locations of the values of one message.

    Attributes:
        leaves: Values by path, such as `pose/position/x` or `data/3`.
        counts: Numbers of elements of arrays by path.
        fixed: Spans that must be equal in another message for this layout to be valid for it: the lengths.
    """

    leaves: dict[str, Leaf]
    counts: dict[str, int]
    fixed: list[tuple[int, int]]


def lay_out(message_type: MessageType, raw: bytes) -> Layout:
    """Finds the values of a serialised message.

    Arrays become one value an element (`K/0`, `K/1`, ...). Variable-length arrays of bytes, and arrays of
    more than `MAX_ARRAY_COLUMNS` numbers, are one value of kind `BYTES`.

    Raises:
        LimitError: If it has too many values, or one whose path is too long.
        ValueError: If the message does not fit its type.
    """
    cursor = _Cursor(raw)
    cursor.read_message(message_type, "")
    if cursor.at != len(raw):
        raise ValueError(f"{len(raw)} bytes, of which {message_type.name} takes {cursor.at}")
    return cursor.layout


class _Cursor:
    """Walks through one message, field by field."""

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
