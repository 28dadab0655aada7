"""JSON Schemas of the YAML files of a world: main file, objects and cameras."""

import copy

from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.json_schema import (
    DEFINITIONS,
    Schema,
    json_schemas,
    mapping_in,
    resolved,
    with_definitions,
)
from rpbi.bodies import BODY_TYPES
from rpbi.config.object_entry import FILE
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.config.world import main_file_model

from .legacy import FOLLOWERS, LEGACY_KEYS, MAIN, old_keys
from .loading import CAMERAS
from .objects import OWN_TYPES, TYPE, object_sections

WORLD = "world"
"""Name of the file kind to which main files belong."""
_FILE_NAME = {"type": "string", "minLength": 1}
_ENTRY = "entry"
"""Name of the schema definition for an entry of a list in the main file."""


def sections() -> dict[str, type[ConfigModel]]:
    """Returns the models of object and camera files, indexed by the key under which the main file lists such files."""
    return {**object_sections(), CAMERAS: RgbdSensorConfig}


def kind_of(section: str) -> str:
    """Returns the kind of the files in a list of the main file, such as `robot` for the list `robots`."""
    return section.removesuffix("s")


def file_schemas() -> dict[str, Schema]:
    """Returns the schemas indexed by kind of file (`world`, `robot` and so on), without keys of older worlds.

    A schema accepts everything that the model of the same files accepts. Only the model checks rules that a schema
    cannot express, such as unique names or existing files.
    """
    files = json_schemas(
        {WORLD: main_file_model(sections())} | {kind_of(section): model for section, model in sections().items()}
    )
    for section in sections():
        file = files[kind_of(section)]
        types = [kind for kind, body_type in BODY_TYPES.items() if body_type.section == section]
        if section == OWN_TYPES:
            files[kind_of(section)] = _of_any_type(file)
        elif types:
            about = "Type of the object. By default, it follows from the list in the main file and from the other keys."
            file["properties"] = {**file["properties"], TYPE: {"description": about, "enum": [*types, None]}}
    return files


def schemas() -> dict[str, Schema]:
    """Returns the schemas for editors, indexed by kind of file.

    In addition to `file_schemas`, these schemas accept keys that only older worlds use. In the main file's lists, they
    also accept entries that name a file and override keys of this file. The schema of such an entry is the definition
    `entry` in the schema of the named file, such as `robot.schema.json#/$defs/entry`.
    """
    files = file_schemas()
    world = _with_old_keys(files[WORLD], MAIN)
    result = {WORLD: world}
    for section in sections():
        kind = kind_of(section)
        entry = {"$ref": f"{kind}.schema.json#/{DEFINITIONS}/{_ENTRY}"}
        world["properties"][section]["items"]["anyOf"] = [_FILE_NAME, entry]
        result[kind] = _with_entry(_with_old_keys(files[kind], section))
    return result


def _of_any_type(schema: Schema) -> Schema:
    """Adds the required key `type` to the schema of object files, and allows further keys, which depend on the type."""
    known = {"type": "string", "enum": list(BODY_TYPES)}
    own = {"type": "string", "pattern": r"^[\w.]+:\w+$"}
    kind = {"description": "Class of the object as `module:Class`, or the name of a type.", "anyOf": [own, known]}
    return {
        **schema,
        "description": "An object whose file names its type, which may be a class of your own.",
        "additionalProperties": True,
        "properties": {TYPE: kind, **schema["properties"]},
        "required": [TYPE, *schema["required"]],
    }


def _with_entry(schema: Schema) -> Schema:
    """Extends a schema of a file by the definition of a list entry, which names a file and may override its keys."""
    path = {"description": "File with all keys that this entry does not override.", **_FILE_NAME}
    entry = {
        "description": "A file, and keys that override keys of the file.",
        "type": "object",
        "additionalProperties": schema["additionalProperties"],
        "properties": {FILE: path, **{key: {"$ref": f"#/properties/{key}"} for key in schema["properties"]}},
        "required": [FILE],
    }
    definitions = {name: _optional(each, schema) for name, each in schema.get(DEFINITIONS, {}).items()}
    inner = _required(schema, schema).get("properties")
    return {
        **_optional(schema, schema),
        "required": schema["required"],
        **({"allOf": [{"properties": inner}]} if inner else {}),
        DEFINITIONS: {_ENTRY: entry, **definitions},
    }


def _optional(schema: Schema, root: Schema) -> Schema:
    """Returns a schema in which all keys are optional, also in nested mappings, but not in mappings within lists."""
    result = {key: value for key, value in schema.items() if key != "required"}
    if "properties" in schema:
        result["properties"] = {key: _optional(value, root) for key, value in schema["properties"].items()}
    if "anyOf" in schema:
        result["anyOf"] = [_optional(each, root) for each in schema["anyOf"]]
    if isinstance(schema.get("items"), dict):
        required = _required(schema["items"], root)
        result["items"] = {"allOf": [schema["items"], required]} if required else schema["items"]
    return result


def _required(schema: Schema, root: Schema) -> Schema:
    """Returns only the parts of a schema that make keys of mappings required, also in nested mappings."""
    mapping = mapping_in(schema, root) if "items" not in schema else None
    if mapping is None:
        return {}
    content = resolved(mapping, root)
    inner = {key: _required(value, root) for key, value in content["properties"].items()}
    result = {"required": content.get("required"), "properties": {key: each for key, each in inner.items() if each}}
    return {key: value for key, value in result.items() if value}


def _with_old_keys(schema: Schema, section: str) -> Schema:
    """Extends a schema by the accepted keys of older worlds, which are marked as deprecated."""
    result = copy.deepcopy(schema)
    properties = result["properties"]
    for key, advice in old_keys(section).items():
        outer, _, inner = key.partition(".")
        same = properties.get(LEGACY_KEYS.get(section, {}).get(key), {})
        old = {**same, "description": advice, "deprecated": True, "deprecationMessage": advice}
        mapping = mapping_in(properties[outer], result) if outer in properties else None
        if mapping is None:
            properties[key] = old
        else:
            content = resolved(mapping, result)
            mapping.pop("$ref", None)
            mapping |= {**content, **mapping, "description": properties[outer]["description"]}
            mapping["properties"] = {**content["properties"], inner: old}
            if outer == "object_tf" and section in FOLLOWERS:
                mapping.pop("required", None)
    return with_definitions(result, result.get(DEFINITIONS, {}))
