"""Converts values of recorded commands and configurations to text, and back without loss."""

import json
import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.foreign import load_foreign_json
from custom_ros_tools.plugins import UntrustedError, check_trusted, find, trusting_only
from custom_ros_tools.schema import ConfigModel

PAIRS = "pairs"
"""JSON key for a mapping, which is written as a list of key-value pairs, since its keys need not be strings."""
QUOTED = 60
"""Largest number of characters that an error message quotes from an invalid text."""


def trusting(packages: Collection[str] | None) -> AbstractContextManager[None]:
    """Returns a context in which a recording may use only classes of `rpbi` and of given packages.

    Args:
        packages: Further packages whose classes are allowed. None allows all packages, for recordings made by this
            program itself.
    """
    if packages is None:
        return nullcontext()
    return trusting_only({"rpbi", *packages}, "name its package (trust=[...]), if you know who made it")


def to_text(value: Any) -> str:
    """Returns a value as JSON.

    Floats are written so that reading restores them exactly. Named tuples and configurations are written as
    `{"module:Class": fields}`.

    Raises:
        TypeError: If the value contains an object of a type that cannot be written.
    """
    return json.dumps(_plain(value), separators=(",", ":"))


def from_text(text: str) -> Any:
    """Reads a value from a text that `to_text` wrote; lists become tuples.

    Raises:
        ValueError: If the text was not written by `to_text`, or contains a class that is missing or not trusted.
        ConfigError: If a configuration in the text is not valid on this machine, for instance if a file is missing.
    """
    try:
        plain = load_foreign_json(text, "recorded value")
    except ConfigError as error:
        raise ValueError(str(error)) from None
    try:
        return _value(plain)
    except (RecursionError, TypeError) as error:
        raise ValueError(f"expected what a recording has, got {text[:QUOTED]!r}...: {error}") from None


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, ConfigModel):
        # Only keys that were set explicitly, since only these are passed to PyBullet
        return {_class_name(value): value.model_dump(mode="json", exclude_unset=True)}
    if isinstance(value, Mapping):
        return {PAIRS: [[_plain(key), _plain(item)] for key, item in value.items()]}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {_class_name(value): [_plain(item) for item in value]}
    if isinstance(value, Sequence):
        return [_plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} cannot be recorded; expected numbers, texts, tuples, named tuples")


def _value(plain: Any) -> Any:
    if isinstance(plain, list):
        return tuple(map(_value, plain))
    if not isinstance(plain, dict):
        return plain
    if len(plain) != 1:
        raise ValueError(f"expected one key, got {', '.join(plain)}")
    ((key, content),) = plain.items()
    if key == PAIRS:
        return {_value(name): _value(item) for name, item in content}
    made = _class_of(key)
    if issubclass(made, ConfigModel):
        return made.parse(content, "~recorded")
    return made(*map(_value, content))


FORMER_MODULES = {
    "rpbi.config.attachments": "rpbi.config.world",
    "rpbi.control.streams.bounded_motion": "rpbi.control.stream_motion",
    "rpbi.control.streams.jitter_buffer": "rpbi.control.jitter_buffer",
    "rpbi.control.streams.segment": "rpbi.control.stream_motion",
    "rpbi.control.streams.sender_clock": "rpbi.control.sender_clock",
    "rpbi.control.streams.target_stream": "rpbi.control.target_stream",
    "rpbi.control.trajectories.tolerances": "rpbi.control.trajectories.request",
}
"""Present module names, indexed by the module names in older recordings and keyframes."""
FORMER_NAMES = {
    "rpbi.constraints.attachment_config:AttachmentConfig": "rpbi.config.world:AttachmentConfig",
    "rpbi.control.controllers.force:ForceConfig": "rpbi.control.controllers.force:ForceControllerConfig",
    "rpbi.control.controllers.manager:NewGains": "rpbi.control.controllers.manager:ControllerUpdate",
    "rpbi.control.motors:Command": "rpbi.control.motors:ResolvedCommand",
    "rpbi.engine.actions:RecordedTrajectory": "rpbi.world.actions:RecordedTrajectory",
    "rpbi.engine.actions:TimedGoal": "rpbi.world.actions:TimedGoal",
    "rpbi.urdf.joints:JointTarget": "rpbi.control.joint_command:JointCommand",
}
"""Present names of single classes, indexed by their names in older recordings."""
_NAME_IN_JSON = re.compile(r'(?<=")rpbi[\w.]+:[\w.]+(?=")')


def with_present_names(text: str) -> str:
    """Replaces former class names in JSON by their present names, and returns the new JSON."""
    return _NAME_IN_JSON.sub(lambda match: _present_name(match[0]), text)


def _present_name(name: str) -> str:
    module, _, attribute = name.partition(":")
    return FORMER_NAMES.get(name) or f"{FORMER_MODULES.get(module, module)}:{attribute}"


def _class_name(value: Any) -> str:
    return f"{type(value).__module__}:{type(value).__qualname__}"


def _class_of(name: str) -> type:
    """Returns the named tuple or configuration class with a given name.

    Other classes are refused, so that a file cannot execute arbitrary code.

    Raises:
        ValueError: If the class is missing, not trusted, or of another kind.
    """
    try:
        check_trusted(name)
        kind = find(_present_name(name))
    except UntrustedError:
        raise
    except ValueError as error:
        raise ValueError(f"'{name}' is not known here: {error}") from None
    if isinstance(kind, type) and (
        issubclass(kind, ConfigModel) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))
    ):
        return kind
    raise ValueError(f"'{name}' is neither a named tuple nor a configuration")
