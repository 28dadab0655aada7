"""JSON Schemas of all YAML files that a world is made of."""

from __future__ import annotations

from typing import Any

from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import Schema, json_schema, without_required
from rpbi.bodies import BODY_TYPES, BodyConfig

from .legacy import LEGACY_KEYS, MAIN, NO_EFFECT
from .loading import CAMERAS
from .object_entry import FILE
from .objects import OWN_TYPES, TYPE
from .sensors import RgbdSensorConfig
from .world import WorldConfig

WORLD = "world"
"""Name of the main file among the kinds of YAML files."""


def sections() -> dict[str, type[ConfigModel]]:
    """Returns the models of the files that the lists of the main file name, by list."""
    objects = {body_type.section: body_type.Config for body_type in BODY_TYPES.values()}
    return {**objects, OWN_TYPES: BodyConfig, CAMERAS: RgbdSensorConfig}


def kind_of(section: str) -> str:
    """Returns what a file of a list is called, such as `robot` for `robots`."""
    return section.removesuffix("s")


def schemas() -> dict[str, Schema]:
    """Returns the schemas by kind of file: `world`, `robot`, `dynamic_object` and so on.

    What no schema can say, such as that names are unique or files exist, is left to the models: what they take, a
    schema takes.
    """
    files = {kind_of(section): _of_file(section, model) for section, model in sections().items()}
    return {WORLD: _of_main_file(files), **files}


def _of_file(section: str, model: type[ConfigModel]) -> Schema:
    schema = json_schema(model, kind_of(section).replace("_", " "))
    types = [kind for kind, body_type in BODY_TYPES.items() if body_type.section == section]
    if section == OWN_TYPES:
        schema = _of_any_type(schema)
    elif types:
        about = "Its type; as a rule that follows from the list of the main file and the other keys."
        schema["properties"][TYPE] = {"description": about, "enum": [*types, None]}
    return _with_old_keys(schema, section)


def _of_any_type(schema: Schema) -> Schema:
    """Returns the schema of files that tell their type themselves, and with it what further keys they have."""
    known = {"type": "string", "enum": list(BODY_TYPES)}
    own = {"type": "string", "pattern": r"^[\w.]+:\w+$"}
    kind = {"description": "Its class, as `module:Class`, or a type that is known here.", "anyOf": [own, known]}
    return {
        **schema,
        "description": "An object whose file tells its type, such as one of your own.",
        "additionalProperties": True,
        "properties": {TYPE: kind, **schema["properties"]},
        "required": [TYPE, *schema["required"]],
    }


def _of_main_file(files: dict[str, Schema]) -> Schema:
    schema = _with_old_keys(json_schema(WorldConfig, WORLD), MAIN)
    for section in sections():
        schema["properties"][section]["items"] = _entry(files[kind_of(section)])
    return schema


def _entry(file: Schema) -> Schema:
    """Returns the schema of an entry of a list: a file name, or a mapping with `file` and the keys that differ."""
    path = {"description": "File that has the keys which are not here.", "type": "string", "minLength": 1}
    keys = without_required(file)["properties"]
    instance = {
        "description": "A file, and what is different for this one.",
        "type": "object",
        "additionalProperties": file["additionalProperties"],
        "properties": {FILE: path, **keys},
        "required": [FILE],
    }
    return {"expects": "a list of files", "anyOf": [{"type": "string", "minLength": 1}, instance]}


def _with_old_keys(schema: Schema, section: str) -> Schema:
    """Adds the keys of older worlds that still load."""
    properties = schema["properties"]
    for old, new in LEGACY_KEYS.get(section, {}).items():
        properties[old] = {**properties[new], **_deprecated(f"Old spelling: write {new}.")}
    for key, advice in NO_EFFECT.get(section, {}).items():
        outer, _, inner = key.partition(".")
        is_inside = bool(inner) and outer in properties
        place, name = (properties[outer]["properties"], inner) if is_inside else (properties, key)
        place[name] = _deprecated(f"No effect: {advice}.")
    return schema


def _deprecated(message: str) -> dict[str, Any]:
    return {"description": message, "deprecated": True, "deprecationMessage": message}
