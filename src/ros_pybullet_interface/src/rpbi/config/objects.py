"""One object of a world: its type and its validated configuration."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from custom_ros_tools.errors import ConfigError, Problem, hint
from custom_ros_tools.plugins import find_class
from custom_ros_tools.schema import ConfigModel
from rpbi.bodies.body import Body
from rpbi.bodies.body_config import BodyConfig
from rpbi.plugins import config_of

from .legacy import modernise

_Model = TypeVar("_Model", bound=ConfigModel)

RESERVED_NAME = "world"
"""No object may have it: `rpbi/world` is the frame that all poses are in."""


OWN_TYPES = Body.section
"""List of the main file for objects whose files tell their type themselves."""
TYPE = "type"
"""Key of an object's file for that: a key of the table of body types, or `module:Class`."""


class BodyType(Protocol):
    """What this module asks of a class of bodies."""

    @property
    def Config(self) -> type[BodyConfig]:  # noqa: N802
        """Model of its YAML file."""

    @property
    def section(self) -> str:
        """List of the main file that names its files."""

    @property
    def is_soft(self) -> bool:
        """Whether it may be tied to bodies of other types, which therefore come first."""

    def claims(self, data: Mapping[str, Any], /) -> bool:
        """Tells whether a YAML of that list is one of this type."""


@dataclass(frozen=True)
class ObjectConfig:
    """One object to be put into a world.

    Attributes:
        type: Key of its class in the table of body types, or `module:Class`.
        config: Its validated configuration.
        file: The file it came from, as the user wrote it.
    """

    type: str
    config: BodyConfig
    file: str


def sections_of(body_types: Mapping[str, BodyType]) -> list[str]:
    """Return the lists of the main file that name objects, in the order in which they are loaded."""
    rigid = [body_type.section for body_type in body_types.values() if not body_type.is_soft]
    soft = [body_type.section for body_type in body_types.values() if body_type.is_soft]
    return list(dict.fromkeys([*rigid, OWN_TYPES, *soft]))


def type_of(section: str, data: Any, body_types: Mapping[str, BodyType]) -> str:
    """Return the type of an object: what it says itself, else what the list of the main file says that names it.

    Args:
        section: The list, such as `robots`.
        data: What the object's file says; if it is no mapping, any type of the list will do to say so.
        body_types: The classes of bodies by type.
    """
    given = data.get(TYPE) if isinstance(data, Mapping) else None
    if given is not None or section == OWN_TYPES:
        return str(given or "")
    of_section = [kind for kind, body_type in body_types.items() if body_type.section == section]
    if isinstance(data, Mapping):
        return next((kind for kind in of_section if body_types[kind].claims(data)), of_section[0])
    return of_section[0]


def load_object(
    kind: str,
    data: Mapping[str, Any],
    file: str,
    body_types: Mapping[str, BodyType],
    context: Mapping[str, Any] | None = None,
) -> BodyConfig:
    """Validate one object.

    Args:
        kind: Key of its class in `body_types`, or `module:Class`.
        data: What its file says; it is not changed.
        file: Name of that file.
        body_types: The classes of bodies by type.
        context: For files: `file` (the path, if `file` is not it), `search_paths`, `robot_description`.

    Raises:
        ConfigError: with all of its problems; one of them may be that there is no such type.
    """
    problems = [Problem(file, "name", f"'{RESERVED_NAME}' is reserved")] if name_in(data) == RESERVED_NAME else []
    try:
        body_type = _body_type(kind, file, body_types)
        if isinstance(data, Mapping):
            data = {key: value for key, value in data.items() if key != TYPE}
        config = parse_section(body_type.section, data, file, body_type.Config, context or {})
    except ConfigError as error:
        problems += error.problems
    if problems:
        raise ConfigError(problems)
    return config


def _body_type(kind: str, file: str, body_types: Mapping[str, BodyType]) -> BodyType:
    if kind in body_types:
        return body_types[kind]
    if ":" not in kind:
        known = f"expected 'module:Class', or one of {', '.join(body_types)}"
        message = f"unknown object type '{kind}'{hint(kind, body_types)}" if kind else known
        raise ConfigError([Problem(file, TYPE, message)])
    try:
        found = find_class(kind, Body)
        config_of(found, BodyConfig)
    except ValueError as error:
        raise ConfigError([Problem(file, TYPE, str(error))]) from None
    return found


def parse_section(
    section: str, data: Mapping[str, Any], file: str, model: type[_Model], context: Mapping[str, Any]
) -> _Model:
    """Validate a mapping, old spellings included; problems name the key as the user spelt it."""
    if not isinstance(data, Mapping):
        return model.parse(data, file)
    current, spellings, problems = modernise(section, data, file)
    try:
        result = model.parse(current, file, context)
    except ConfigError as error:
        for problem in error.problems:
            key = _respelt(problem.key, spellings)
            problems.append(Problem(problem.file, key, problem.message))
    if problems:
        raise ConfigError(problems)
    return result


def _respelt(key: str, spellings: Mapping[str, str]) -> str:
    match = re.match(r"[^.\[]*", key)
    first = match[0] if match else ""
    return spellings.get(first, first) + key[len(first) :]


def name_in(data: Any) -> str | None:
    """Return the name that an object goes by, if it has any."""
    name = data.get("name") if isinstance(data, Mapping) else None
    return name if isinstance(name, str) else None
