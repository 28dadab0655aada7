"""Reads numeric fields from serialised messages. The fields are selected by name."""

from __future__ import annotations

import re
import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError, hint, shortened
from rpbi_data.bags.message_layout import NUMBER_DTYPES, SCALAR, Field, Leaf, MessageType, lay_out
from rpbi_data.bags.row_plan import STAMP, plan_rows

MAX_LINES = 16
"""Largest number of lines for one name. A name may denote all numbers of an array or of a part of a message."""
MAX_OFFERED = 12
"""Largest number of fields that an error message lists."""
_INDEX = re.compile(r"\[(\d+)\]")
_TIMES = ("time", "duration")


@dataclass(eq=False)
class FieldError(InterfaceError):
    """A name does not denote a numeric field of a topic's messages."""

    topic: str
    type: str
    message: str

    def __str__(self) -> str:
        return f"{self.topic} ({self.type}): {self.message}"


class Values(NamedTuple):
    """Numbers read from one message.

    Attributes:
        stamp_s: Stamp in the message's header [s]; None without a header or if the stamp is 0.
        by_name: Numbers, keyed by the field's path below the topic.
    """

    stamp_s: float | None
    by_name: dict[str, float]


def split_name(name: str, topics: Collection[str]) -> tuple[str, str] | None:
    """Splits a name such as `/arm/joint_states/position[0]` into the topic and the path of the field.

    Args:
        name: Name with a leading slash. The field may also be written as `position/0` or `position/JOINT`.
        topics: Names of topics. The longest topic with which `name` begins is chosen.

    Returns:
        Topic and path of the field; None if `name` begins with none of the topics.
    """
    path = _INDEX.sub(r"/\1", name)
    fitting = [topic for topic in topics if f"{path}/".startswith(f"{topic}/")]
    if not fitting:
        return None
    topic = max(fitting, key=len)
    return topic, path[len(topic) :].strip("/")


class FieldReader:
    """Reads one numeric field, or all numbers in an array or sub-message, from the messages of one topic.

    The message type may change between messages.

    Args:
        topic: Name of the topic, for error messages.
        path: Path of the field, array or sub-message; empty for the whole message.
    """

    def __init__(self, topic: str, path: str) -> None:
        self.topic, self.path = topic, path
        self._plan: _Plan | None = None

    def read(self, message_type: MessageType, raw: bytes) -> Values:
        """Returns the selected numbers of a message. The result is empty if an array is too short for the path.

        Raises:
            FieldError: If the message type lacks the field, or the field is not numeric.
            ValueError: If the bytes do not fit the message type.
        """
        plan = self._plan
        if plan is None or not plan.fits(message_type, raw):
            plan = self._plan = self._make_plan(message_type, raw)
        return plan.values(raw)

    def _make_plan(self, message_type: MessageType, raw: bytes) -> _Plan:
        layout = lay_out(message_type, raw)
        rows = plan_rows(message_type, raw)
        leaves, fixed = layout.leaves, layout.fixed
        if len(rows.rows) == 1:  # these leaves are named by joint
            leaves, fixed = {**rows.rows[0], **leaves}, rows.fixed
        found = self._chosen(message_type, leaves)
        stamp = leaves.get(STAMP) if message_type.has_header else None
        return _Plan(message_type, [(*span, raw[slice(*span)]) for span in fixed], len(raw), stamp, found)

    def _chosen(self, message_type: MessageType, leaves: Mapping[str, Leaf]) -> dict[str, Leaf]:
        """Returns the numeric leaves at or below the path, keyed by name. Raises FieldError if the path is wrong."""
        if self.path in leaves:
            if not _is_number(leaves[self.path]):
                what = "text" if leaves[self.path].kind == "string" else "binary data"
                raise self._error(message_type, f"expected a number, '{self.path}' is {what}")
            return {self.path: leaves[self.path]}
        prefix = f"{self.path}/" if self.path else ""
        below = {name: leaf for name, leaf in leaves.items() if name.startswith(prefix) and _is_number(leaf)}
        if not self.path:
            below = {name: leaf for name, leaf in below.items() if not name.startswith("header/")}
        one_each = {leaf.start: name for name, leaf in reversed(below.items())}  # prefers joint names
        chosen = [name for name in below if name in one_each.values()]
        if chosen or _may_have_numbers(message_type, self.path):
            if len(chosen) > MAX_LINES:
                raise self._error(
                    message_type, f"'{self.path}' has {len(chosen)} numbers: expected at most {MAX_LINES}, name some"
                )
            return {name: below[name] for name in chosen}
        numbers = [name for name, leaf in leaves.items() if _is_number(leaf)]
        if not self.path:
            raise self._error(message_type, "expected numbers, there are none in it")
        asked = hint(self.path, numbers)
        if asked.startswith("; known"):
            asked = f"; known are {', '.join(numbers[:MAX_OFFERED])}{', ...' if len(numbers) > MAX_OFFERED else ''}"
        raise self._error(message_type, f"unknown field '{shortened(self.path)}'{asked}")

    def _error(self, message_type: MessageType, message: str) -> FieldError:
        return FieldError(self.topic, message_type.name, message)


class _Plan:
    """Byte positions of the selected numbers in messages that have the same layout."""

    def __init__(
        self,
        message_type: MessageType,
        fixed: list[tuple[int, int, bytes]],
        size: int,
        stamp: Leaf | None,
        leaves: Mapping[str, Leaf],
    ) -> None:
        self._type, self._fixed, self._size = message_type, fixed, size
        self._stamp = None if stamp is None else stamp.start
        self._leaves = [(name, leaf.kind, _struct(leaf.kind), leaf.start) for name, leaf in leaves.items()]

    def fits(self, message_type: MessageType, raw: bytes) -> bool:
        """Returns whether a message has the type and the layout of this plan."""
        if message_type is not self._type or len(raw) != self._size:
            return False
        return all(raw[start:stop] == content for start, stop, content in self._fixed)

    def values(self, raw: bytes) -> Values:
        stamp_s = None
        if self._stamp is not None:
            seconds, nanoseconds = struct.unpack_from("<II", raw, self._stamp)
            stamp_s = seconds + 1e-9 * nanoseconds or None
        found = {}
        for name, kind, reading, start in self._leaves:
            number = reading.unpack_from(raw, start)
            found[name] = number[0] + 1e-9 * number[1] if kind in _TIMES else float(number[0])
        return Values(stamp_s, found)


def _struct(kind: str) -> struct.Struct:
    if kind in _TIMES:
        return struct.Struct("<II" if kind == "time" else "<ii")
    return struct.Struct(f"<{NUMBER_DTYPES[kind].char}")


def _is_number(leaf: Leaf) -> bool:
    return leaf.kind in NUMBER_DTYPES or leaf.kind in _TIMES


def _may_have_numbers(field_type: str | MessageType, path: str) -> bool:
    """Returns whether messages of a type have numbers at or below a path, provided that arrays are long enough."""
    if not isinstance(field_type, MessageType):
        return not path and field_type != "string"
    paths = ((field, _path_below(field, path)) for field in field_type.fields)
    return any(below is not None and _may_have_numbers(field.type, below) for field, below in paths)


def _path_below(field: Field, path: str) -> str | None:
    """Returns the part of a path after a field's name and array index; None if the path begins with another field.

    The empty path matches all fields except headers.
    """
    if not path:
        return None if field.name == "header" else ""
    name, _, rest = path.partition("/")
    index = "0"
    if field.length != SCALAR and rest:
        index, _, rest = rest.partition("/")
    return rest if name == field.name and index.isdecimal() else None
