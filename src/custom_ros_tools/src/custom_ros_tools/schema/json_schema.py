"""JSON Schemas of configuration models, for editors: they complete, explain and check YAML while it is written.

The dialect is draft-07, the newest that yaml-language-server understands.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

Schema = dict[str, Any]

DIALECT = "http://json-schema.org/draft-07/schema#"
_LINE = 110
"""Longest line that is not broken."""
_MAPPINGS_OF_SCHEMAS = ("properties", "patternProperties")
_ALTERNATIVES = ("anyOf", "oneOf")
_FIRST_KEYS = ("$schema", "title", "description", "type", "kind", "expects", "unit", "default")


def json_schema(model: type[BaseModel], title: str) -> Schema:
    """Returns the schema of a YAML file.

    It has no references, so that each key stands with all that is known of it. Beside what draft-07 has, `unit` states
    units, `kind` families of constants, and `expects` says in words what a value has to be.

    Args:
        model: What the file is validated with.
        title: What it is, such as `"robot"`.
    """
    raw = model.model_json_schema()
    tree = _plain(raw, raw.get("$defs", {}))
    return _ordered({"$schema": DIALECT, "title": title, **tree})


def unit_in(schema: Schema) -> str | None:
    """Returns the unit of a value, or of the numbers in it; None if it has none."""
    if "unit" in schema:
        return str(schema["unit"])
    inner = [schema["items"]] if isinstance(schema.get("items"), dict) else schema.get("anyOf", [])
    return next(filter(None, map(unit_in, inner)), None)


def explained(schema: Schema) -> Schema:
    """Returns a schema whose descriptions end with unit and default, since editors show nothing but these."""
    result = {key: explained(value) if isinstance(value, dict) else value for key, value in schema.items()}
    if "anyOf" in schema:
        result["anyOf"] = [explained(each) for each in schema["anyOf"]]
    for key, value in schema.get("properties", {}).items():
        result["properties"][key] = _explained_property(value, result["properties"][key])
    return result


def without_required(schema: Schema) -> Schema:
    """Returns a schema of the same keys of which none is required, nor any in mappings inside of them."""
    result = {key: value for key, value in schema.items() if key != "required"}
    if "properties" in schema:
        result["properties"] = {key: without_required(value) for key, value in schema["properties"].items()}
    if "anyOf" in schema:
        result["anyOf"] = [without_required(each) for each in schema["anyOf"]]
    return result


def _explained_property(schema: Schema, result: Schema) -> Schema:
    if "deprecated" in schema:
        return result
    unit = unit_in(schema)
    parts = [schema.get("description", ""), f"[{unit}]" if unit else ""]
    if "default" in schema:
        parts.append(f"Default: {yaml_text(schema['default'])}.")
    return {**result, "description": " ".join(filter(None, parts))}


def yaml_text(value: Any) -> str:
    """Returns plain data as one would write it in a line of YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e6:
        return f"{value:.0f}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(yaml_text, value))}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {yaml_text(each)}" for key, each in value.items()) + "}"
    return str(value)


def _plain(schema: Schema, definitions: Mapping[str, Schema]) -> Schema:
    """Returns a schema of pydantic without references, titles and what is newer than draft-07."""
    if "$ref" in schema:
        inner = definitions[schema["$ref"].removeprefix("#/$defs/")]
        return _plain({**inner, **{key: value for key, value in schema.items() if key != "$ref"}}, definitions)
    result: Schema = {}
    for key, value in schema.items():
        if key in ("$defs", "title"):
            continue
        if key in _MAPPINGS_OF_SCHEMAS:
            result[key] = {name: _plain(each, definitions) for name, each in value.items()}
        elif key in _ALTERNATIVES:
            result["anyOf"] = [_plain(each, definitions) for each in value]
        elif key == "prefixItems":
            result["items"] = _one_for_all([_plain(each, definitions) for each in value])
        elif isinstance(value, dict) and key != "default":
            result[key] = _plain(value, definitions)
        else:
            result[key] = value
    return _ordered(_without_idle_default(_with_flat_alternatives(result)))


def _one_for_all(items: list[Schema]) -> Schema | list[Schema]:
    """Returns the schema that all items of a list share, or those of each."""
    return items[0] if all(item == items[0] for item in items) else items


def _with_flat_alternatives(schema: Schema) -> Schema:
    """Merges alternatives inside of alternatives, and a single one with null."""
    if "anyOf" not in schema:
        return schema
    alternatives: list[Schema] = []
    for each in schema["anyOf"]:
        if "anyOf" not in each:
            alternatives.append(each)
            continue
        alternatives += each["anyOf"]
        schema = {**{key: value for key, value in each.items() if key != "anyOf"}, **schema}
    others = [each for each in alternatives if each != {"type": "null"}]
    has_null = len(others) < len(alternatives)
    rest = {key: value for key, value in schema.items() if key != "anyOf"}
    if has_null and len(others) == 1 and isinstance(others[0].get("type"), str) and "enum" not in others[0]:
        return {**others[0], **rest, "type": [others[0]["type"], "null"]}
    return {**rest, "anyOf": alternatives}


def _ordered(schema: Schema) -> Schema:
    """Puts first what a reader looks for first."""
    return {key: schema[key] for key in (*_FIRST_KEYS, *sorted(schema)) if key in schema}


def _without_idle_default(schema: Schema) -> Schema:
    """Drops a default that says no more than that the key may be left out; editors would type it in."""
    if schema.get("default", "") is None or isinstance(schema.get("default"), dict):
        return {key: value for key, value in schema.items() if key != "default"}
    return schema


def schema_text(schema: Schema) -> str:
    """Returns a schema as JSON for a file, with all that is short in one line."""
    return _text(schema, "") + "\n"


def _text(value: Any, indent: str) -> str:
    short = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, (dict, list)) or len(indent) + len(short) <= _LINE:
        return short
    inner = indent + "  "
    if isinstance(value, dict):
        items = [f"{json.dumps(key)}: {_text(each, inner)}" for key, each in value.items()]
        opening, closing = "{", "}"
    else:
        items = [_text(each, inner) for each in value]
        opening, closing = "[", "]"
    return f"{opening}\n{inner}" + f",\n{inner}".join(items) + f"\n{indent}{closing}"
