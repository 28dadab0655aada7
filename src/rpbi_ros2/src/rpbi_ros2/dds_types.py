"""Types of DDS for messages of ROS 2, whose samples are messages in CDR that stay as they are."""

from __future__ import annotations

from typing import Any

from custom_ros_tools.errors import MissingDependency
from rpbi_data.bags.message_layout import SCALAR, VARIABLE

from .layouts import Ros2Field, Ros2Type
from .type_hash import message_of

try:
    from cyclonedds.idl import IdlStruct, make_idl_struct, types
except ImportError:
    raise MissingDependency("cyclonedds", "./rpbi setup ros2") from None

PRIMITIVES: dict[str, Any] = {
    "bool": bool, "byte": types.byte, "char": types.uint8, "int8": types.int8, "uint8": types.uint8,
    "int16": types.int16, "uint16": types.uint16, "int32": types.int32, "uint32": types.uint32,
    "int64": types.int64, "uint64": types.uint64, "float32": types.float32, "float64": types.float64, "string": str,
}  # fmt: skip
"""Types of cyclonedds for the primitive types of ROS 1."""


class Sample(IdlStruct):
    """A message in CDR. A subclass for each type has its name and fields, which only discovery uses."""

    def __init__(self, cdr: bytes) -> None:
        self.cdr = cdr  # without an annotation in the class, which would be a field

    def serialize(self, *_: Any, **__: Any) -> bytes:
        """Returns the message in CDR."""
        return self.cdr

    @classmethod
    def deserialize(cls, data: bytes, *_: Any, **__: Any) -> Sample:
        """Makes a sample of a message in CDR."""
        return cls(data)

    deserialize_key = deserialize


def dds_class(message_type: Ros2Type, made: dict[str, type[Sample]] | None = None) -> type[Sample]:
    """Makes the class of a type's samples.

    Args:
        message_type: The type.
        made: Classes of types inside it that exist already, by name.
    """
    made = {} if made is None else made
    if message_type.name not in made:
        fields = {f"{field.name}_": _annotation(field, made) for field in message_type.members}
        name = message_type.name.rpartition("/")[2]
        struct: Any = make_idl_struct(name, message_type.dds_name, fields, dataclassify=False, bases=(Sample,))
        made[message_type.name] = struct
    return made[message_type.name]


def _annotation(field: Ros2Field, made: dict[str, type[Sample]]) -> Any:
    inner = message_of(field)
    element = PRIMITIVES[str(field.type)] if inner is None else dds_class(inner, made)
    if field.length == SCALAR:
        return element
    arrays: Any = types  # its generic types are no types for mypy
    return arrays.sequence[element] if field.length == VARIABLE else arrays.array[element, field.length]
