"""Goals and constraints from plain mappings, as services, files and the terminal give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from custom_ros_tools.errors import hint
from robot_model.geometry import Pose


def built(table: Mapping[str, type[Any]], kind: str, data: Mapping[str, Any]) -> Any:
    """Makes an object of the dataclass that the key `type` names; the other keys are its fields.

    Lists become tuples, and a pose is a mapping with `position` and, optionally, `quat_xyzw`.

    Raises:
        ValueError: If the type or a key is unknown, a key is missing, or a value is invalid; the message names the key.
    """
    if not isinstance(data, Mapping):
        raise ValueError(f"{kind}: expected a mapping, got {data!r}")
    name = str(data.get("type"))
    if name not in table:
        raise ValueError(f"{kind}: type: expected one of {', '.join(table)}, got {name!r}{hint(name, table)}")
    known = {each.name: each for each in fields(table[name])}
    for key in data:
        if key != "type" and key not in known:
            raise ValueError(f"{kind}: unknown key '{key}'{hint(key, known)}; there are {', '.join(known)}")
    missing = [
        key
        for key, each in known.items()
        if key not in data and each.default is MISSING and each.default_factory is MISSING
    ]
    if missing:
        raise ValueError(f"{kind}: {', '.join(missing)}: expected a value, got none")
    values = {key: _value(f"{kind}: {key}", key, value) for key, value in data.items() if key != "type"}
    try:
        return table[name](**values)
    except TypeError as error:
        raise ValueError(f"{kind}: {error}") from None


def pose_from(data: Any, what: str = "pose") -> Pose:
    """Makes a pose from a mapping with `position` [m] and, optionally, `quat_xyzw`.

    Raises:
        ValueError: If the mapping has other keys, or a value is no list of numbers.
    """
    if isinstance(data, Pose):
        return data
    if not isinstance(data, Mapping) or "position" not in data or not set(data) <= {"position", "quat_xyzw"}:
        raise ValueError(f"{what}: expected a mapping with 'position' and 'quat_xyzw', got {data!r}")
    return Pose(_numbers(f"{what}: position", data["position"], 3),
                _numbers(f"{what}: quat_xyzw", data.get("quat_xyzw", (0.0, 0.0, 0.0, 1.0)), 4))  # fmt: skip


def _value(what: str, key: str, value: Any) -> Any:
    if key == "pose":
        return pose_from(value, what)
    if isinstance(value, list | tuple):
        return _numbers(what, value, len(value))
    if isinstance(value, Mapping):
        return {str(name): _number(f"{what}: {name}", each) for name, each in value.items()}
    return value if isinstance(value, str) or value is None else _number(what, value)


def _numbers(what: str, values: Any, count: int) -> Any:
    if not isinstance(values, list | tuple) or len(values) != count:
        raise ValueError(f"{what}: expected {count} numbers, got {values!r}")
    return tuple(_number(what, value) for value in values)


def _number(what: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{what}: expected a number, got {value!r}")
    return float(value)
