"""Messages of ROS 1 with random values, and classes of all types that the bridge to ROS 2 converts."""

from __future__ import annotations

import random
import string
import struct
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import genpy
from genmsg.msgs import parse_type
from genpy.base import is_simple
from roslib.message import get_message_class

from rpbi_ros2.layouts import OWN_PACKAGES, RefusedTypeError, Ros2Type, ros2_type

RANGES = {
    "byte": (-(2**7), 2**7), "char": (0, 2**8), "int8": (-(2**7), 2**7), "uint8": (0, 2**8),
    "int16": (-(2**15), 2**15), "uint16": (0, 2**16), "int32": (-(2**31), 2**31), "uint32": (0, 2**32),
    "int64": (-(2**63), 2**63), "uint64": (0, 2**64),
}  # fmt: skip
FLOATS = (0.0, -0.0, 1.0, float("inf"), float("-inf"), 5e-324, 1.7976931348623157e308)
LENGTHS = (0, 0, 1, 2, 3, 7, 40)
ACTION_PARTS = ("Action", "ActionGoal", "ActionResult", "ActionFeedback", "Goal", "Result", "Feedback")
TEXTS = ("", "a", "rpbi/world", "\u00e4\u6f22\U0001f916", "with\nlines", "x" * 300)


def message_classes(package: str) -> list[Any]:
    """Returns the classes of all messages of a package, without those of its actions."""
    module = import_module(f"{package}.msg")
    found = [each for each in vars(module).values() if isinstance(each, type) and issubclass(each, genpy.Message)]
    actions = [each.__name__.removesuffix("Action") for each in found if each.__name__.endswith("Action")]
    parts = {f"{action}{part}" for action in actions for part in ACTION_PARTS}
    return [each for each in found if each.__name__ not in parts]


def converted_classes(package: str) -> Iterator[tuple[Any, Ros2Type]]:
    """Yields the message classes of a package that the bridge converts, with their layouts in ROS 2."""
    for message_class in message_classes(package):
        try:
            yield message_class, ros2_type(message_class._type, message_class._full_text, OWN_PACKAGES)
        except RefusedTypeError:
            continue


def without_seq(value: Any) -> Any:
    """Returns a message as nested lists and values, without the numbers of headers, which ROS 2 lacks."""
    if isinstance(value, genpy.Message):
        names = [name for name in value.__slots__ if (value._type, name) != ("std_msgs/Header", "seq")]
        return [without_seq(getattr(value, name)) for name in names]
    return [without_seq(each) for each in value] if isinstance(value, (list, tuple)) else value


def random_message(message_class: Any, generator: random.Random) -> Any:
    """Returns a message with random values, strings and lengths of arrays."""
    message = message_class()
    for name, type_name in zip(message_class.__slots__, message_class._slot_types):
        setattr(message, name, _value(type_name, generator))
    return message


def _value(type_name: str, generator: random.Random) -> Any:
    base, is_array, length = parse_type(type_name)
    if not is_array:
        return _single(base, generator)
    count = generator.choice(LENGTHS) if length is None else length
    if base in ("uint8", "char"):
        return generator.randbytes(count)
    return [_single(base, generator) for _ in range(count)]


def _single(base: str, generator: random.Random) -> Any:
    if base == "string":
        return generator.choice([*TEXTS, "".join(generator.choices(string.printable, k=generator.randrange(20)))])
    if base == "bool":
        return generator.random() < 0.5
    if base == "time":
        return genpy.Time(generator.randrange(2**32), generator.randrange(10**9))
    if base == "duration":
        return genpy.Duration(generator.randrange(-(2**31), 2**31), generator.randrange(10**9))
    if base in ("float32", "float64"):
        value = generator.choice([*FLOATS, generator.uniform(-1e6, 1e6), generator.gauss(0.0, 1.0)])
        return value if base == "float64" else _float32(value)
    if is_simple(base):
        return generator.randrange(*RANGES[base])
    return random_message(get_message_class("std_msgs/Header" if base == "Header" else base), generator)


def _float32(value: float) -> float:
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return 3.0
