"""Translates pydantic's errors to `Problem`s that name the key, the unit and the expected value."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from custom_ros_tools.errors import Problem, hint, shortened

from .annotations import InnerProblemsError, KeyedError
from .json_schema import Schema, json_schema, mapping_in, resolved, unit_in
from .type_names import TYPE_NAMES, number_advice, shown, type_name

MAX_PROBLEMS = 100
"""Largest number of reported problems per file, since the search for similar keys is slow."""
_LENGTH_ERRORS = ("missing", "too_long", "too_short")
_RULES = {
    "greater_than": "must be > {gt:g}",
    "greater_than_equal": "must be >= {ge:g}",
    "less_than": "must be < {lt:g}",
    "less_than_equal": "must be <= {le:g}",
    "finite_number": "must be a finite number",
    "literal_error": "must be {expected}",
    "float_type": f"expected {TYPE_NAMES['number']}",
    **dict.fromkeys(("int_type", "int_from_float"), f"expected {TYPE_NAMES['integer']}"),
    "bool_type": f"expected {TYPE_NAMES['boolean']}",
    "string_type": f"expected {TYPE_NAMES['string']}",
    **dict.fromkeys(
        ("dict_type", "model_type", "model_attributes_type", "mapping_type"), f"expected {TYPE_NAMES['object']}"
    ),
}
"""Description of the expected value for each type of pydantic error. Names in braces are keys of the error's context.
"""


def problems_of(error: ValidationError, model: type[BaseModel], data: Mapping[str, Any], file: str) -> list[Problem]:
    """Translates the errors of a failed validation to problems.

    Args:
        error: pydantic's error.
        model: The model.
        data: The validated data.
        file: Name of the file, for error messages.
    """
    problems = []
    all_details = error.errors(include_url=False)
    for details in all_details[:MAX_PROBLEMS]:
        loc = _real_location(details, data)
        raised = details.get("ctx", {}).get("error")
        if isinstance(raised, InnerProblemsError):
            problems += [Problem(file, _joined(key_path(loc), each.key), each.message) for each in raised.problems]
        else:
            problems.append(Problem(file, *_explain(details, loc, _schema_of(model))))
    if len(all_details) > MAX_PROBLEMS:
        problems.append(Problem(file, "", f"and {len(all_details) - MAX_PROBLEMS} more problems"))
    return list(dict.fromkeys(problems))  # alternatives of a union may give equal problems


def key_path(loc: Sequence[str | int]) -> str:
    """Converts a pydantic error location to a key path such as `intrinsics.range[1]`."""
    text = ""
    for part in loc:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def _joined(outer: str, inner: str) -> str:
    return ".".join(filter(None, (outer, inner)))


def _real_location(details: ErrorDetails, data: Any) -> tuple[str | int, ...]:
    """Returns an error's location in the data, without the labels that pydantic adds for unions and validators."""
    kept: list[str | int] = []
    here: Any = data
    for part in details["loc"]:
        if isinstance(here, Mapping) and part in here:
            here = here[part]
        elif isinstance(here, (list, tuple)) and isinstance(part, int) and part < len(here):
            here = here[part]
        elif details["type"] not in ("missing", "invalid_key") or part != details["loc"][-1]:
            continue
        kept.append(part)
    return tuple(kept)


@lru_cache(maxsize=100)
def _schema_of(model: type[BaseModel]) -> Schema:
    return json_schema(model, model.__name__)


def _property_at(root: Schema, loc: Sequence[str | int]) -> Schema | None:
    """Returns the schema of the last key in a location; None if a key is unknown."""
    found, here = None, root
    for part in loc:
        mapping = mapping_in(here, root)
        if isinstance(part, str) and mapping is not None:
            keys = resolved(mapping, root)
            found = here = keys["properties"].get(part, keys.get("additionalProperties"))
            if not isinstance(here, dict):
                return None
    return found


def _explain(details: ErrorDetails, loc: tuple[str | int, ...], root: Schema) -> tuple[str, str]:
    """Returns the key path and the message for a pydantic error.

    Args:
        details: The error.
        loc: Location of the error in the data.
        root: JSON Schema of the file.
    """
    kind, value, context = details["type"], details["input"], details.get("ctx", {})
    wanted = _property_at(root, loc)
    unit = f" [{unit_in(wanted)}]" if wanted and unit_in(wanted) else ""
    error = context.get("error")
    if isinstance(error, KeyedError):
        return _joined(key_path(loc), error.key), error.message
    if kind in _LENGTH_ERRORS and isinstance(value, (list, tuple)):
        where = loc[:-1] if kind == "missing" else loc
        depth = len(where) - max((i + 1 for i, part in enumerate(where) if isinstance(part, str)), default=0)
        return key_path(where), f"expected {_expected(wanted, depth)}{unit}, got {len(value)}"
    if kind == "missing":
        return key_path(loc), f"missing, expected {_expected(wanted)}{unit}"
    if kind in ("extra_forbidden", "invalid_key"):
        return key_path(loc), f"unknown key '{shortened(str(loc[-1]))}'{hint(str(loc[-1]), _siblings(root, loc))}"
    if isinstance(error, Exception):
        return key_path(loc), str(error)
    rule = _RULES[kind].format_map(context) if kind in _RULES else f"expected {_expected(wanted)}"
    return key_path(loc), f"{rule}{unit}, got {shown(value)}{number_advice(kind, value)}"


def _expected(wanted: Schema | None, depth: int = 0) -> str:
    """Describes the expected value of a key; with `depth` 1, the items of a list, with 2, the items of its items."""
    if wanted is None:
        return "another value"
    for _ in range(depth):
        wanted = next((each["items"] for each in (wanted, *wanted.get("anyOf", ())) if "items" in each), {})
    return type_name(wanted)


def _siblings(root: Schema, loc: Sequence[str | int]) -> list[str]:
    """Returns the keys that are allowed at the location of an unknown key."""
    mapping = mapping_in(_property_at(root, loc[:-1]) or root, root)
    return list(resolved(mapping, root)["properties"]) if mapping else []
