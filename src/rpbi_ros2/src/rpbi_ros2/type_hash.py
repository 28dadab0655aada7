"""The hash by which ROS 2 compares message types, `RIHS01`: SHA-256 of a description of the type as JSON."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from rpbi_data.bags.message_layout import SCALAR, VARIABLE

from .layouts import Ros2Field, Ros2Type

NESTED, ARRAY, SEQUENCE = 1, 48, 144
NUMBERS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float32": 10, "float64": 11, "char": 3, "bool": 15, "byte": 16, "string": 17,
}  # fmt: skip
"""Numbers of the primitive types of ROS 1 in these descriptions."""
TIMES = {
    name: Ros2Type(f"builtin_interfaces/{name.title()}", (Ros2Field("sec", "int32"), Ros2Field("nanosec", "uint32")))
    for name in ("time", "duration")
}
"""The messages that `time` and `duration` are in ROS 2."""


def type_hash(message_type: Ros2Type) -> str:
    """Returns the hash of a type, such as `RIHS01_a13e...`."""
    nested: dict[str, Ros2Type] = {}
    _collect(message_type, nested)
    description = {
        "type_description": _description(message_type),
        "referenced_type_descriptions": [_description(nested[name]) for name in sorted(nested)],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


def message_of(field: Ros2Field) -> Ros2Type | None:
    """Returns the message type of a field in ROS 2; None if it is primitive."""
    return TIMES.get(field.type) if isinstance(field.type, str) else field.type


def full_name(message_type: Ros2Type) -> str:
    """Returns the name of a type in ROS 2, such as `sensor_msgs/msg/JointState`."""
    return message_type.name.replace("/", "/msg/")


def _collect(message_type: Ros2Type, nested: dict[str, Ros2Type]) -> None:
    for field in message_type.members:
        inner = message_of(field)
        if inner is not None:
            nested[full_name(inner)] = inner
            _collect(inner, nested)


def _description(message_type: Ros2Type) -> dict[str, Any]:
    return {"type_name": full_name(message_type), "fields": [_field(field) for field in message_type.members]}


def _field(field: Ros2Field) -> dict[str, Any]:
    inner = message_of(field)
    number = NUMBERS[str(field.type)] if inner is None else NESTED
    number += 0 if field.length == SCALAR else SEQUENCE if field.length == VARIABLE else ARRAY
    kind = {
        "type_id": number,
        "capacity": max(field.length, 0),
        "string_capacity": 0,
        "nested_type_name": "" if inner is None else full_name(inner),
    }
    return {"name": field.name, "type": kind}
