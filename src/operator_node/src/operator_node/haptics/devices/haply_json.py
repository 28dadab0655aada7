"""Reads and writes the JSON messages of a Haply Inverse3's service: states and forces."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from operator_node.haptics.device import ReadingError
from robot_model.geometry import ZERO, Quaternion, Vector


class HaplyState(NamedTuple):
    """State in a message of the service. The axes are those of the service: x right, y forward, z up.

    Attributes:
        position: Position of the cursor [m].
        velocity: Velocity of the cursor [m/s].
        quat_xyzw: Orientation of the grip, x, y, z, w; identity without a grip.
        buttons: For each button of the grip, 1 while the button is held, otherwise 0.
        force: Force of the device on the hand, as reported by the service [N].
    """

    position: Vector
    velocity: Vector
    quat_xyzw: Quaternion
    buttons: tuple[int, ...]
    force: Vector


def command_of(device_id: str, force: Vector, key: str) -> str:
    """Returns the JSON message that sends a force to a device.

    Args:
        device_id: Id of the Inverse3.
        force: Force in the axes of `HapticReading` [N].
        key: Name of the force's vector in the message: `vector` or `values`.
    """
    x, y, z = -force[1], force[0], force[2]
    commands = {"set_cursor_force": {key: {"x": x, "y": y, "z": z}}}
    return json.dumps({"inverse3": [{"device_id": device_id, "commands": commands}]})


def device_in(frame: str | bytes, device_id: str) -> str:
    """Returns `device_id`, or the id of the first Inverse3 in a message if `device_id` is empty.

    Raises:
        ReadingError: If the message does not contain an Inverse3, or not the one with the id `device_id`.
    """
    known = [str(each.get("device_id", "")) for each in _entries(_message(frame), "inverse3")]
    if not known or (device_id and device_id not in known):
        names = f"it has {', '.join(known)}" if known else "it has none"
        raise ReadingError("no device", f"expected an Inverse3{device_id and f' {device_id}'}, {names}")
    return device_id or known[0]


def state_in(frame: str | bytes, device_id: str) -> HaplyState:
    """Returns the state of the Inverse3 `device_id` in a message, including its first grip.

    Raises:
        ReadingError: If the state is missing, or a number is not finite.
    """
    message = _message(frame)
    states = [each for each in _entries(message, "inverse3") if each.get("device_id") == device_id]
    if not states:
        raise ReadingError("no device", f"a message without Inverse3 {device_id}")
    state = _mapping(states[0], "state")
    quat: Quaternion = (0.0, 0.0, 0.0, 1.0)
    buttons: tuple[int, ...] = ()
    for kind in ("verse_grip", "wireless_verse_grip"):
        for grip in _entries(message, kind)[:1]:
            held = _mapping(grip, "state")
            x, y, z, w = _numbers(held, "orientation", "xyzw")
            quat = x, y, z, w
            pressed = held.get("buttons", {"a": held.get("button", False)})
            if not isinstance(pressed, dict):
                raise ReadingError("not a state", f"expected buttons by name, got {type(pressed).__name__}")
            buttons = tuple(int(bool(pressed[name])) for name in sorted(pressed))
    force = _vector(state, "current_cursor_force") if "current_cursor_force" in state else ZERO
    return HaplyState(_vector(state, "cursor_position"), _vector(state, "cursor_velocity"), quat, buttons, force)


def _message(frame: str | bytes) -> dict[str, Any]:
    try:
        message = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise ReadingError("not JSON", str(error)[:80]) from None
    if not isinstance(message, dict):
        raise ReadingError("not a state", f"expected a JSON object, got {type(message).__name__}")
    return message


def _entries(message: dict[str, Any], key: str) -> list[dict[str, Any]]:
    entries = message.get(key, [])
    if not isinstance(entries, list) or not all(isinstance(each, dict) for each in entries):
        raise ReadingError("not a state", f"expected {key} to be a list of objects")
    return entries


def _mapping(entry: dict[str, Any], key: str) -> dict[str, Any]:
    found = entry.get(key)
    if not isinstance(found, dict):
        raise ReadingError("not a state", f"expected an object {key}, got {type(found).__name__}")
    return found


def _numbers(state: dict[str, Any], key: str, names: str) -> list[float]:
    values = _mapping(state, key)
    numbers = []
    for name in names:
        value = values.get(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ReadingError("not a state", f"expected a number {key}.{name}, got {type(value).__name__}")
        if not abs(value) < 1e9:
            raise ReadingError("not finite", f"{key}.{name} is not a finite number below 1e9")
        numbers.append(float(value))
    return numbers


def _vector(state: dict[str, Any], key: str) -> Vector:
    x, y, z = _numbers(state, key, "xyz")
    return x, y, z
