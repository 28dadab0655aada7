"""Words for what a key may be, from its JSON Schema."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from custom_ros_tools.schema.json_schema import Schema, unit_in

from .markdown import code, link

_NOUNS = ("whole number", "number", "text", "value", "list", "mapping")
_WORDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}


def type_in_words(schema: Schema) -> str:
    """Returns what a value may be, with its range and unit, as Markdown."""
    unit = unit_in(schema)
    return _words(schema) + (f" [{unit}]" if unit else "")


def heading_of(kind: str) -> str:
    """Returns the heading of a family of constants."""
    return f"{kind}s"


def constants_in(schema: Schema) -> Iterator[tuple[str, list[str]]]:
    """Yields the families of constants anywhere in a schema: what they are, and their names."""
    if "kind" in schema:
        yield schema["kind"], next(each["enum"] for each in schema["anyOf"] if each.get("type") == "string")
    for inner in _inner(schema):
        yield from constants_in(inner)


def mapping_in(schema: Schema) -> Schema | None:
    """Returns the mapping with keys of its own that a value is, or each item of a list; None if there is none."""
    alternatives = [schema, *schema.get("anyOf", ())]
    for each in alternatives:
        if "properties" in each:
            return each
    items = (each["items"] for each in alternatives if isinstance(each.get("items"), dict))
    return next(filter(None, map(mapping_in, items)), None)


def _inner(schema: Schema) -> Iterator[Schema]:
    yield from schema.get("properties", {}).values()
    yield from schema.get("anyOf", ())
    for key in ("items", "additionalProperties"):
        if isinstance(schema.get(key), dict):
            yield schema[key]


def _words(schema: Schema) -> str:
    if "kind" in schema:
        is_several = any("pattern" in each for each in schema["anyOf"])
        return link(heading_of(schema["kind"])) + (", one or several" if is_several else ", one")
    if "expects" in schema:
        return str(schema["expects"]).removeprefix("a ")
    if "anyOf" in schema:
        return _either(schema["anyOf"])
    if "enum" in schema:
        return " or ".join(code(str(each)) for each in schema["enum"] if each is not None)
    kinds = schema.get("type", [])
    others = [kinds] if isinstance(kinds, str) else [each for each in kinds if each != "null"]
    kind = others[0] if len(others) == 1 else "value"
    if kind == "array":
        return _list(schema)
    if kind == "object":
        inner = None if "properties" in schema else schema.get("additionalProperties")
        return f"mapping of names to {_plural(inner)}" if isinstance(inner, dict) and "type" in inner else "mapping"
    return (_WORDS.get(kind, kind) + " " + _range(schema)).strip()


def _either(alternatives: Iterable[Schema]) -> str:
    words = dict.fromkeys(_words(each) for each in alternatives if each != {"type": "null"})
    if "true or false" in words:
        words.pop("whole number 0 to 1", None)  # the same in other words
    return " or ".join(words)


def _list(schema: Schema) -> str:
    items = schema.get("items")
    if not isinstance(items, dict):
        return "list"
    fixed = schema.get("minItems") == schema.get("maxItems") and schema.get("minItems")
    return f"list of {f'{fixed} ' if fixed else ''}{_plural(items)}"


def _plural(schema: Schema) -> str:
    """Returns the words for several of a kind, such as `numbers, each > 0` or `lists of 3 numbers`."""
    words = _words(schema)
    if "kind" in schema:
        return words
    noun = next((each for each in _NOUNS if words.startswith(each)), words)
    rest = words.removeprefix(noun)
    bounds = _range(schema)
    return f"{noun}s, each {bounds}" if bounds else f"{noun}s{rest}"


def _range(schema: Schema) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    if "exclusiveMinimum" in schema:
        signs.pop("minimum")
    return ", ".join(f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema)
