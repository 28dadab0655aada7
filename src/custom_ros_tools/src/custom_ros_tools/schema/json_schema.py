"""JSON Schemas of configuration models; editors check YAML by them, and error messages and reference pages use them.

The dialect is draft-07, the newest that yaml-language-server understands. In addition, `unit` states units, `kind`
families of constants, and `expects` describes the expected value in words. Models inside models are references to
`$defs`; a description next to a reference is that of the key. The first alternative of an `anyOf` is the usual form;
the others are accepted, too.
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
"""Keywords that restrict values of whatever type."""


class EditorSchema(GenerateJsonSchema):
    """pydantic's generator, in draft-07 and without entries that are useless in editors."""

    # constraints that no schema can express are checked by the model
    ignored_warning_kinds = {"skipped-choice", "non-serializable-default"}

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def model_schema(self, schema: core_schema.ModelSchema) -> Schema:
        result = super().model_schema(schema)
        result.pop("title", None)
        return result

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> Schema:
        """Drops a default that only means that the key is optional; editors would insert it."""
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
        """Merges schemas of different types into one: a keyword of draft-07 restricts values of one type only."""
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
    """Returns the schema of a YAML file that is validated with a model; `title` names the kind of file, such as
    `"robot"`.
    """
    return json_schemas({title: model})[title]


def json_schemas(models: Mapping[str, type[BaseModel]]) -> dict[str, Schema]:
    """Returns the schemas of several YAML files, by title, in which the same mapping has the same name."""
    mode: JsonSchemaMode = "validation"
    inputs = [(model, mode) for model in dict.fromkeys(models.values())]
    references, common = models_json_schema(inputs, schema_generator=EditorSchema)
    schemas = {}
    for title, model in models.items():
        content = resolved(references[model, mode], common)
        schemas[title] = with_definitions({"$schema": DIALECT, "title": title, **content}, common[DEFINITIONS])
    return schemas


def with_definitions(schema: Schema, definitions: Mapping[str, Schema]) -> Schema:
    """Returns a self-contained schema, with the definitions that it refers to."""
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
    """Yields the names of the referenced definitions anywhere in a schema."""
    if isinstance(value, dict):
        if "$ref" in value:
            yield name_of(value)
        value = list(value.values())
    for each in value if isinstance(value, list) else ():
        yield from references_in(each)


def name_of(reference: Schema) -> str:
    """Returns the name of the definition that a schema refers to."""
    return str(reference["$ref"]).rsplit("/", 1)[-1]


def resolved(schema: Schema, root: Schema) -> Schema:
    """Returns a schema, or the definition in `root`, the schema of the file, that it refers to."""
    return dict(root[DEFINITIONS][name_of(schema)]) if "$ref" in schema else schema


def mapping_in(schema: Schema, root: Schema) -> Schema | None:
    """Returns the schema of the mapping that describes a value, or each item of a list; None if the value is no
    mapping.

    It may be a reference to the definitions in `root`, the schema of the file.
    """
    for each in (schema, *schema.get("anyOf", ())):
        if "properties" in resolved(each, root):
            return each
    items = (each["items"] for each in (schema, *schema.get("anyOf", ())) if isinstance(each.get("items"), dict))
    return next(filter(None, (mapping_in(each, root) for each in items)), None)


def types_in(schema: Schema) -> list[str]:
    """Returns the JSON types that a schema names."""
    kinds = schema.get("type", [])
    return [kinds] if isinstance(kinds, str) else list(kinds)


def unit_in(schema: Schema) -> str | None:
    """Returns the unit of a value, or of the numbers in it; None if it has none."""
    if "unit" in schema:
        return str(schema["unit"])
    inner = [*schema.get("anyOf", ()), *(schema.get(key) for key in ("items", "additionalProperties"))]
    return next(filter(None, (unit_in(each) for each in inner if isinstance(each, dict))), None)


def explained(value: Any) -> Any:
    """Returns a schema whose descriptions end with unit and default, since editors show only descriptions.

    The description of a key is also added to its alternatives with references; otherwise editors show the mapping's
    description.
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
    """Returns plain data as it would be written in a line of YAML."""
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
    """Returns the text of the file of each schema by its path in a folder."""
    return {folder / f"{name}.schema.json": schema_text(explained(schema)) for name, schema in by_name.items()}


def schema_text(schema: Schema) -> str:
    """Returns a schema as JSON for a file."""
    return json.dumps(schema, ensure_ascii=False, indent=1) + "\n"
