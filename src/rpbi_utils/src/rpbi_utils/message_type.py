"""Message types read from the definition that every bag carries, so that no generated class is needed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import genmsg
from genmsg.msg_loader import load_msg_from_string

SCALAR = -1
VARIABLE = -2

_SEPARATOR = "=" * 80  # between a definition and those of the types it uses
BYTE_TYPES = ("uint8", "char")


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
        fields: Its fields in the order in which they are serialised.
    """

    name: str
    fields: tuple[Field, ...]

    @classmethod
    def parse(cls, name: str, definition: str) -> MessageType:
        """Reads a definition as bags carry it: the type's text, then a `MSG: package/Type` section for each it uses.

        Raises:
            ValueError: If the text is no valid definition.
        """
        context = genmsg.MsgContext.create_default()
        try:
            texts = _split(name, definition)
            specs = {each: load_msg_from_string(context, text, each) for each, text in texts}
            return cls._build(name, specs, ())
        except (genmsg.InvalidMsgSpec, ValueError, KeyError) as error:
            raise ValueError(f"definition of {name} cannot be read: {error}") from error

    @classmethod
    def _build(cls, name: str, specs: Mapping[str, genmsg.MsgSpec], outer: tuple[str, ...]) -> MessageType:
        if name in outer:
            raise ValueError(f"{name} contains itself")
        fields = []
        for field in specs[name].parsed_fields():
            base = field.base_type
            field_type = base if field.is_builtin else cls._build(base, specs, (*outer, name))
            length = (VARIABLE if field.array_len is None else field.array_len) if field.is_array else SCALAR
            fields.append(Field(field.name, field_type, length))
        return cls(name, tuple(fields))

    @property
    def has_header(self) -> bool:
        """Whether it starts with a `std_msgs/Header`, and so has a stamp."""
        first, length = self.fields[0][1:] if self.fields else ("", SCALAR)
        return isinstance(first, MessageType) and first.name == "std_msgs/Header" and length == SCALAR

    @property
    def holds_bytes(self) -> bool:
        """Whether it has a variable number of bytes (`uint8[]`) anywhere, as images and point clouds do."""
        return any(
            field.type.holds_bytes
            if isinstance(field.type, MessageType)
            else field.type in BYTE_TYPES and field.length == VARIABLE
            for field in self.fields
        )


def _split(name: str, definition: str) -> Iterator[tuple[str, str]]:
    """Yields the name and text of each type in a full definition."""
    sections = definition.split(_SEPARATOR)
    yield name, sections[0]
    for section in sections[1:]:
        title, _, text = section.strip().partition("\n")
        if not title.startswith("MSG:"):
            raise ValueError(f"expected 'MSG: package/Type', got '{title}'")
        yield title.removeprefix("MSG:").strip(), text
