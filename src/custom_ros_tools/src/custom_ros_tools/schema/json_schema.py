"""JSON Schemas of configuration models, for editors that check YAML, for error messages and for reference pages.

The dialect is draft-07, the newest dialect that yaml-language-server supports. Three keywords are added. `unit` is the
unit of a number, `kind` is the name of a family of constants, and `expects` describes the expected value in words. A
model inside another model is a reference to `$defs`. A description that follows the reference describes the key. In an
`anyOf`, the first alternative is the usual form, and the other alternatives are accepted as well.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaMode, models_json_schema
from pydantic_core import core_schema

Schema = dict[str, Any]

DIALECT = "http://json-schema.org/draft-07/schema#"
DEFINITIONS = "$defs"
NULL: Schema = {"type": "null"}
_FOR_ALL_TYPES = {"anyOf", "enum", "const", "$ref"}
"""JSON Schema keywords that restrict values of all types."""


class EditorSchema(GenerateJsonSchema):
    """pydantic's schema generator, adapted to draft-07; leaves out entries that are useless in editors."""

    # the model itself checks constraints that a schema cannot express
    ignored_warning_kinds = {"skipped-choice", "non-serializable-default"}

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def model_schema(self, schema: core_schema.ModelSchema) -> Schema:
        result = super().model_schema(schema)
        result.pop("title", None)
        return result

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> Schema:
        """Leaves out the default None and defaults that are mappings, since editors would insert these defaults."""
        result = super().default_schema(schema)
        if result.get("default") is None or isinstance(result["default"], dict):
            result.pop("default", None)
        return result

    def tuple_schema(self, schema: core_schema.TupleSchema) -> Schema:
        result = super().tuple_schema(schema)
        if "prefixItems" in result:
            items = result.pop("prefixItems")
            result["items"] = items[0] if all(item == items[0] for item in items) else items
        return result

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> Schema:
        return self.get_union_of_schemas([self.generate_inner(choice) for choice in schema["choices"].values()])

    def get_union_of_schemas(self, schemas: list[Schema]) -> Schema:
        """Merges alternatives into one schema if all types and keywords differ, or makes an `anyOf`.

        Merging is possible because most keywords of draft-07 only restrict values of one type.
        """
        types = [kind for each in schemas for kind in types_in(each)]
        keywords = [key for each in schemas for key in each if key != "type"]
        is_clear = all(map(types_in, schemas)) and not _FOR_ALL_TYPES.intersection(keywords)
        if is_clear and len({*types, *keywords}) == len(types) + len(keywords):
            return {**{key: value for each in schemas for key, value in each.items()}, "type": types}
        first, *others = schemas
        return {**first, "anyOf": [*first["anyOf"], *others]} if "anyOf" in first else {"anyOf": schemas}

    def handle_invalid_for_json_schema(self, schema: Any, error_info: str) -> Schema:
        return {}


def json_schema(model: type[BaseModel], title: str) -> Schema:
    """Generates the JSON Schema of a YAML file.

    Args:
        model: Model with which the file is validated.
        title: Title of the schema: the kind of file, such as `"robot"`.
    """
    return json_schemas({title: model})[title]


def json_schemas(models: Mapping[str, type[BaseModel]]) -> dict[str, Schema]:
    """Generates the JSON Schemas of several kinds of YAML files. A nested model has the same name in all schemas.

    Args:
        models: Model of each kind of file, indexed by title.

    Returns:
        The schemas, indexed by title.
    """
    mode: JsonSchemaMode = "validation"
    inputs = [(model, mode) for model in dict.fromkeys(models.values())]
    references, common = models_json_schema(inputs, schema_generator=EditorSchema)
    schemas = {}
    for title, model in models.items():
        content = resolved(references[model, mode], common)
        schemas[title] = with_definitions({"$schema": DIALECT, "title": title, **content}, common[DEFINITIONS])
    return schemas


def with_definitions(schema: Schema, definitions: Mapping[str, Schema]) -> Schema:
    """Returns a schema with the definitions added that the schema refers to, directly or indirectly."""
    content = {key: value for key, value in schema.items() if key != DEFINITIONS}
    found: dict[str, Schema] = {}
    waiting = [*references_in(content)]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found[name] = definitions[name]
            waiting += references_in(found[name])
    return {**content, DEFINITIONS: dict(sorted(found.items()))} if found else content


def references_in(value: Any) -> Iterator[str]:
    """Yields the names of all definitions that a schema refers to directly."""
    if isinstance(value, dict):
        if "$ref" in value:
            yield name_of(value)
        value = list(value.values())
    for each in value if isinstance(value, list) else ():
        yield from references_in(each)


def name_of(reference: Schema) -> str:
    """Returns the name of the definition in a reference, `{"$ref": ...}`."""
    return str(reference["$ref"]).rsplit("/", 1)[-1]


def resolved(schema: Schema, root: Schema) -> Schema:
    """Returns the definition that a reference refers to; returns schemas that are not references unchanged.

    Args:
        schema: The schema or reference.
        root: Schema of the file, which contains the definitions.
    """
    return dict(root[DEFINITIONS][name_of(schema)]) if "$ref" in schema else schema


def mapping_in(schema: Schema, root: Schema) -> Schema | None:
    """Returns the schema of the mapping if a value may be a mapping or a list of mappings.

    Args:
        schema: Schema of the value.
        root: Schema of the file, which contains the definitions.

    Returns:
        The schema, which may be a reference; None if the value cannot be a mapping or a list of mappings.
    """
    for each in (schema, *schema.get("anyOf", ())):
        if "properties" in resolved(each, root):
            return each
    items = (each["items"] for each in (schema, *schema.get("anyOf", ())) if isinstance(each.get("items"), dict))
    return next(filter(None, (mapping_in(each, root) for each in items)), None)


def types_in(schema: Schema) -> list[str]:
    """Returns the JSON types in the keyword `type` of a schema; an empty list if the schema lacks this keyword."""
    kinds = schema.get("type", [])
    return [kinds] if isinstance(kinds, str) else list(kinds)


def unit_in(schema: Schema) -> str | None:
    """Returns the unit of a value, or of the numbers inside the value; None for values without unit."""
    if "unit" in schema:
        return str(schema["unit"])
    inner = [*schema.get("anyOf", ()), *(schema.get(key) for key in ("items", "additionalProperties"))]
    return next(filter(None, (unit_in(each) for each in inner if isinstance(each, dict))), None)


def explained(value: Any) -> Any:
    """Appends units and defaults to the descriptions in a schema, since editors only show descriptions.

    The description of a key is also added to alternatives that are references. Without it, editors would show the
    description of the referenced mapping.

    Returns:
        The new schema.
    """
    if isinstance(value, list):
        return [explained(each) for each in value]
    if not isinstance(value, dict):
        return value
    result = {key: explained(each) for key, each in value.items()}
    if isinstance(value.get("description"), str) and "deprecated" not in value:
        unit = unit_in(value)
        default = f"Default: {yaml_text(value['default'])}." if "default" in value else ""
        text = " ".join(filter(None, (value["description"], f"[{unit}]" if unit else "", default)))
        result["description"] = text
        if "anyOf" in value:
            result["anyOf"] = [{**each, "description": text} if "$ref" in each else each for each in result["anyOf"]]
    return result


def yaml_text(value: Any) -> str:
    """Formats plain data as YAML in one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e6:
        return f"{value:.0f}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(yaml_text, value))}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {yaml_text(each)}" for key, each in value.items()) + "}"
    return str(value)


def schema_texts(folder: Path, by_name: Mapping[str, Schema]) -> dict[Path, str]:
    """Returns the texts of schema files, indexed by path.

    Args:
        folder: Folder of the files.
        by_name: The schemas, indexed by file name without extension.
    """
    return {folder / f"{name}.schema.json": schema_text(explained(schema)) for name, schema in by_name.items()}


def schema_text(schema: Schema) -> str:
    """Formats a schema as the JSON text of a file."""
    return json.dumps(schema, ensure_ascii=False, indent=1) + "\n"
