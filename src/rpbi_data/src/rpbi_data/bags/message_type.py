"""Message types read from the definition that every bag carries, so that no generated class is needed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from custom_ros_tools.errors import shortened

from .limits import MAX_DEFINITION_BYTES, MAX_DEPTH, LimitError

SCALAR = -1
VARIABLE = -2

BYTE_TYPES = ("uint8", "char")
PRIMITIVE_TYPES = frozenset(
    "bool byte char int8 int16 int32 int64 uint8 uint16 uint32 uint64 float32 float64 string time duration".split()
)
_HEADER = (("seq", "uint32", SCALAR), ("stamp", "time", SCALAR), ("frame_id", "string", SCALAR))
_SEPARATOR = "=" * 80  # between a definition and those of the types it uses
_FIELD = re.compile(r"([a-zA-Z][\w/]*)(?:\[(\d{0,10})\])?\s+([a-zA-Z]\w*)", re.ASCII)


class Field(NamedTuple):
    """One field of a message.

    Attributes:
        name: Its name.
        type: The name of a primitive type (`float64`, `string`, `time`, ...), or a message type.
        length: Elements of a fixed-length array, else `SCALAR` or `VARIABLE`.
    """

    name: str
    type: str | MessageType
    length: int = SCALAR


@dataclass(eq=False)
class MessageType:
    """A message type with all the types it is made of.

    Attributes:
        name: Full name, such as `sensor_msgs/JointState`.
        fields: Its fields in the order in which they are serialised, without those that have no bytes: messages
            without fields, arrays of a fixed number of them, and arrays of length 0.
        holds_bytes: Whether it has a variable number of bytes (`uint8[]`) anywhere, as images and point clouds do.
    """

    name: str
    fields: tuple[Field, ...]
    holds_bytes: bool

    @classmethod
    def parse(cls, name: str, definition: str) -> MessageType:
        """Reads a definition as bags carry it: the type's text, then a `MSG: package/Type` section for each it uses.

        It takes time in proportion to the length of the text, as each type is read once.

        Raises:
            ValueError: If the text is no valid definition; a LimitError if it is too long or too deep.
        """
        try:
            if len(definition) > MAX_DEFINITION_BYTES:
                raise LimitError.over(f"{MAX_DEFINITION_BYTES:,} bytes", f"{len(definition):,}")
            return _Builder(dict(_split(name, definition))).build(name)
        except ValueError as error:
            raise type(error)(f"definition of {shortened(name)} cannot be read: {error}") from error

    @property
    def has_header(self) -> bool:
        """Whether it starts with a `std_msgs/Header`, and so has a stamp."""
        first, length = self.fields[0][1:] if self.fields else ("", SCALAR)
        is_header = isinstance(first, MessageType) and first.name == "std_msgs/Header" and first.fields == _HEADER
        return is_header and length == SCALAR


class _Builder:
    """Builds each type of a definition once.

    Args:
        declared: By type the name, the type's name and the length of each field.
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
    """Yields name, type and length of each field that a text declares; constants are no part of messages."""
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
