"""Objects of a world: their types, and the validation of their configurations."""

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
"""Name that objects must not have, since `rpbi/world` is the world frame."""
OWN_TYPES = Body.section
"""Key of the list in the main file for objects whose files contain the object's type."""
TYPE = "type"
"""Key in an object's file for the type of the object: a key of BODY_TYPES, or `module:Class`."""


@dataclass(frozen=True)
class ObjectConfig:
    """Configuration of an object of a world, and the file from which the configuration was read.

    Attributes:
        type: Type of the object: a key of BODY_TYPES, or `module:Class`.
        config: Validated configuration of the object.
        file: Name of the file, as the user wrote the name.
        path: Resolved path of the file; empty if the configuration is not from a file on this machine.
    """

    type: str
    config: BodyConfig
    file: str
    path: str = ""


def object_sections() -> dict[str, type[BodyConfig]]:
    """Returns the configuration models of objects, indexed by the key under which the main file lists such objects.

    The models are in the order in which objects are loaded: soft objects come last.
    """
    rigid: dict[str, type[BodyConfig]] = {}
    soft: dict[str, type[BodyConfig]] = {}
    for body_type in BODY_TYPES.values():
        (soft if body_type.is_soft else rigid).setdefault(body_type.section, config_of(body_type, BodyConfig))
    return {**rigid, OWN_TYPES: BodyConfig, **soft}


def type_of(section: str, data: Any) -> str:
    """Returns the type of an object.

    This is the value of the key `type` in the object's file. Without this key, the type follows from `section` and from
    the file's other keys. In the section OWN_TYPES, the key is required; without the key, the returned type is empty.

    Args:
        section: Key of the main file's list that contains the object, such as `robots`.
        data: Content of the object's file. If the content is not a mapping, returns any type of the section; the caller
            then calls `load_object`, which reports the fault.
    """
    given = data.get(TYPE) if isinstance(data, Mapping) else None
    if given is not None or section == OWN_TYPES:
        return str(given or "")
    of_section = [kind for kind, body_type in BODY_TYPES.items() if body_type.section == section]
    if isinstance(data, Mapping):
        return next((kind for kind in of_section if BODY_TYPES[kind].claims(data)), of_section[0])
    return of_section[0]


def load_object(kind: str, data: Mapping[str, Any], file: str, context: Mapping[str, Any] | None = None) -> BodyConfig:
    """Validates the configuration of one object, and returns it as a model.

    Args:
        kind: Type of the object: a key of BODY_TYPES, or `module:Class`.
        data: Content of the object's file; it is not changed.
        file: Name of the object's file, for messages.
        context: Settings for resolving file names, all optional: `file` (path of the object's file, if the argument
            `file` is not a path), `search_paths` (folders) and `robot_description` (URDF file, see `load_world`).

    Raises:
        ConfigError: If the type is unknown or the content is not valid; the error lists all problems.
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
    """Validates a mapping and returns it as a model; accepts old spellings of keys.

    Args:
        section: `"main"` for the main file; for an object's file, the main file's key under which that file is listed.
        data: Content of the file; it is not changed.
        file: Name of the file, for messages.
        model: Model of the content.
        context: Settings for resolving file names, see `load_object`.

    Raises:
        ConfigError: If the content is not valid; problems name keys as the user spelt them.
    """
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
    """Returns the value of `name` in the content of a file; None if the key is missing or the value is not text."""
    name = data.get("name") if isinstance(data, Mapping) else None
    return name if isinstance(name, str) else None
