"""Describes expected values and given values in words, for error messages and reference pages."""

import math
import re
import reprlib
from collections.abc import Mapping
from typing import Any

from .json_schema import NULL, Schema, types_in

TYPE_NAMES = {
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "string": "text",
    "array": "a list",
    "object": "a mapping",
}
"""Words for values of the JSON types."""
_REPR = reprlib.Repr()
_REPR.maxlevel = 2  # with aliases, a short YAML text can expand to a huge value


def shown(value: Any) -> str:
    """Formats a value similar to YAML, cut to at most 80 characters."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    if isinstance(value, Mapping):
        return "a mapping"
    try:
        text = f"text {value!r}" if isinstance(value, str) else _REPR.repr(value)
    except ValueError:  # whole numbers of thousands of digits
        return "a huge number"
    return text if len(text) <= 80 else text[:77] + "..."


def type_name(schema: Schema, detailed: bool = False, plural: bool = False) -> str:
    """Describes the value that a JSON Schema expects, such as `a list of 3 numbers`.

    Args:
        schema: The schema.
        detailed: Whether the description includes bounds and all accepted forms, instead of only the usual form.
        plural: Whether the description is in the plural, as in `lists of 3 numbers`.
    """
    if "expects" in schema:
        return str(schema["expects"])
    if "kind" in schema:
        kind, names = schema["kind"], constants_in(schema)
        return f"{kind}s such as {'|'.join(names[:2])}" if "anyOf" in schema else f"a {kind} ({', '.join(names)})"
    if "anyOf" in schema:
        alternatives = schema["anyOf"] if detailed else schema["anyOf"][:1]
        return " or ".join(dict.fromkeys(type_name(each, detailed, plural) for each in alternatives if each != NULL))
    if "enum" in schema:
        values = [str(each) for each in schema["enum"] if each is not None]
        return f"{'one of ' if len(values) > 1 else ''}{', '.join(values)}"
    kinds = [kind for kind in types_in(schema) if kind != "null"] or ["object" if "$ref" in schema else ""]
    if "boolean" in kinds:
        return TYPE_NAMES["boolean"]  # 0 and 1 are other forms of the same values
    if plural and len(kinds) > 1:
        return "values"
    return " or ".join(_name_of_type(kind, schema, detailed, plural) for kind in kinds)


def constants_in(schema: Schema) -> list[str]:
    """Returns the names of the constants that a schema allows."""
    names = schema["anyOf"][0]["enum"] if "anyOf" in schema else schema["enum"]
    return [name for name in names if isinstance(name, str)]


def _name_of_type(kind: str, schema: Schema, detailed: bool, plural: bool) -> str:
    if kind == "array" and "items" in schema:
        items = schema["items"][0] if isinstance(schema["items"], list) else schema["items"]
        if "expects" in items:
            return str(items["expects"])
        count = f"{schema['minItems']} " if schema.get("minItems", 0) == schema.get("maxItems") else ""
        return f"{'lists' if plural else 'a list'} of {count}{type_name(items, detailed, plural=True)}"
    name = TYPE_NAMES.get(kind, "a value")
    if plural:
        name = f"{name[2:]}s" if name.startswith("a ") else name
    if not detailed:
        return name
    values = schema.get("additionalProperties")
    if kind == "object" and "properties" not in schema and isinstance(values, dict) and "type" in values:
        return f"{name} of names to {type_name(values, detailed, plural=True)}"
    bounds = _bounds(schema) if kind in ("number", "integer") else ""
    return f"{name}{', each' if plural and bounds else ''} {bounds}".strip()


def _bounds(schema: Schema) -> str:
    if "minimum" in schema and "maximum" in schema:
        return f"{schema['minimum']:g} to {schema['maximum']:g}"
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    if "exclusiveMinimum" in schema:
        signs.pop("minimum")
    return ", ".join(f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema)


def number_advice(kind: str, value: Any) -> str:
    """Returns advice for a number that YAML has read as text, such as `1e-3`, or an empty text for other values.

    Args:
        kind: Type of pydantic's error.
        value: The given value.
    """
    if kind not in ("float_type", "int_type") or not isinstance(value, str):
        return ""
    match = re.fullmatch(r"\s*([-+]?)(\d+|\d*\.\d*\d|\d+\.)[eE]([-+]?)(\d+)\s*", value)
    if match:
        sign, digits, exponent_sign, exponent = match.groups()
        whole, _, fraction = digits.partition(".")
        number = f"{sign}{whole or 0}.{fraction or 0}e{exponent_sign or '+'}{exponent}"
        return f": YAML reads {value.strip()} as text: write {number}"
    if re.fullmatch(r"\s*[-+]?(\d+\.?\d*|\.\d+)\s*", value):
        return ": write it without quotes"
    return ""
