"""One object of a world: its type and its validated configuration."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from custom_ros_tools.errors import ConfigError, Problem, hint
from custom_ros_tools.plugin_table import config_of
from custom_ros_tools.schema import ConfigModel
from rpbi.bodies import BODY_TYPES, Body, BodyConfig

from .file_kinds import check_is_listed_right
from .legacy import modernise

_Model = TypeVar("_Model", bound=ConfigModel)

RESERVED_NAME = "world"
"""No object may have this name: `rpbi/world` is the frame of all poses."""
OWN_TYPES = Body.section
"""List of the main file for objects whose files name their type."""
TYPE = "type"
"""Key of an object's file for that: a key of the table of body types, or `module:Class`."""


@dataclass(frozen=True)
class ObjectConfig:
    """One object of a world.

    Attributes:
        type: Key of its class in the table of body types, or `module:Class`.
        config: Its validated configuration.
        file: The file it came from, as the user wrote it.
        path: Path of that file; empty if there is none.
    """

    type: str
    config: BodyConfig
    file: str
    path: str = ""


def object_sections() -> dict[str, type[BodyConfig]]:
    """Returns the lists of the main file that name objects, in the order of loading, each with its model."""
    rigid: dict[str, type[BodyConfig]] = {}
    soft: dict[str, type[BodyConfig]] = {}
    for body_type in BODY_TYPES.values():
        (soft if body_type.is_soft else rigid).setdefault(body_type.section, config_of(body_type, BodyConfig))
    return {**rigid, OWN_TYPES: BodyConfig, **soft}


def type_of(section: str, data: Any) -> str:
    """Returns the type of an object: its own key, else that of the list in the main file that names it.

    Args:
        section: The list, such as `robots`.
        data: Content of the object's file. If it is not a mapping, some type of the list is returned; its check then
            fails.
    """
    given = data.get(TYPE) if isinstance(data, Mapping) else None
    if given is not None or section == OWN_TYPES:
        return str(given or "")
    of_section = [kind for kind, body_type in BODY_TYPES.items() if body_type.section == section]
    if isinstance(data, Mapping):
        return next((kind for kind in of_section if BODY_TYPES[kind].claims(data)), of_section[0])
    return of_section[0]


def load_object(kind: str, data: Mapping[str, Any], file: str, context: Mapping[str, Any] | None = None) -> BodyConfig:
    """Validates one object.

    Args:
        kind: Key of BODY_TYPES, or `module:Class`.
        data: Content of its file; it is not changed.
        file: Name of that file.
        context: For files: `file` (the path, if `file` is not it), `search_paths`, `robot_description`.

    Raises:
        ConfigError: With all of its problems, an unknown type included.
    """
    problems = [Problem(file, "name", f"'{RESERVED_NAME}' is reserved")] if name_in(data) == RESERVED_NAME else []
    try:
        section, model = _section_and_model(kind, file)
        if isinstance(data, Mapping):
            if kind in BODY_TYPES:
                check_is_listed_right(data, file, section, model.model_fields)
            data = {key: value for key, value in data.items() if key != TYPE}
        config = parse_section(section, data, file, model, context or {})
    except ConfigError as error:
        problems += error.problems
    if problems:
        raise ConfigError(problems)
    return config


def _section_and_model(kind: str, file: str) -> tuple[str, type[BodyConfig]]:
    if kind not in BODY_TYPES and ":" not in kind:
        known = f"expected 'module:Class', or one of {', '.join(BODY_TYPES)}"
        message = f"unknown object type '{kind}'{hint(kind, BODY_TYPES)}" if kind else known
        raise ConfigError([Problem(file, TYPE, message)])
    try:
        body_type = BODY_TYPES.find(kind)
        return body_type.section, config_of(body_type, BodyConfig)
    except ValueError as error:
        raise ConfigError([Problem(file, TYPE, str(error))]) from None


def parse_section(
    section: str, data: Mapping[str, Any], file: str, model: type[_Model], context: Mapping[str, Any]
) -> _Model:
    """Validates a mapping, old spellings included; problems name the key as the user spelt it."""
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
    first = re.split(r"[.\[]", key, maxsplit=1)[0]
    return spellings.get(first, first) + key[len(first) :]


def name_in(data: Any) -> str | None:
    """Returns the name of an object, if it has any."""
    name = data.get("name") if isinstance(data, Mapping) else None
    return name if isinstance(name, str) else None
