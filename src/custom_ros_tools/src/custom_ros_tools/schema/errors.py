"""From pydantic's errors to `Problem`s that name the key, the unit and what to write instead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from custom_ros_tools.errors import Problem, hint

from .annotations import InnerProblemsError, KeyedError
from .type_names import TYPE_WORDS, expected, is_model, number_advice, parts_of, shown, unit_of

_BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", ">="),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "<="),
}
_LENGTH_ERRORS = ("missing", "too_long", "too_short")
_TYPE_ERRORS = {
    "float_type": float,
    "int_type": int,
    "int_from_float": int,
    "bool_type": bool,
    "string_type": str,
    "dict_type": dict,
    "model_type": dict,
    "model_attributes_type": dict,
    "mapping_type": dict,
}


def problems_of(error: ValidationError, model: type[BaseModel], data: Mapping[str, Any], file: str) -> list[Problem]:
    """Translate a validation error.

    Args:
        error: What pydantic raised.
        model: The model that was validated.
        data: What it was validated against.
        file: Name of the file, for the messages.
    """
    found: dict[tuple[str, str], Problem] = {}
    for details in error.errors(include_url=False):
        loc = _real_location(details, data)
        error_raised = details.get("ctx", {}).get("error")
        if isinstance(error_raised, InnerProblemsError):
            inner = [(_joined(key_path(loc), each.key), each.message) for each in error_raised.problems]
        else:
            inner = [_explain(details, loc, _field_at(model, loc), model)]
        for key, message in inner:
            found.setdefault((key, message), Problem(file, key, message))
    return list(found.values())


def key_path(loc: Sequence[str | int]) -> str:
    """Return a location as `intrinsics.range[1]`."""
    text = ""
    for part in loc:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def _joined(outer: str, inner: str) -> str:
    return ".".join(filter(None, (outer, inner)))


def _real_location(details: ErrorDetails, data: Any) -> tuple[str | int, ...]:
    """Return the location without the labels that pydantic adds for unions, validators and dict keys."""
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


def _field_at(model: type[BaseModel], loc: Sequence[str | int]) -> FieldInfo | None:
    """Return the innermost declared field on the way to a location."""
    here: type[BaseModel] | None = model
    field = None
    for part in loc:
        if here is not None and isinstance(part, str) and part in here.model_fields:
            field = here.model_fields[part]
            here = next((t for t in parts_of(field.annotation) if is_model(t)), None)
        elif isinstance(part, str) and (here is not None or field is None):
            return None
    return field


def _explain(
    details: ErrorDetails, loc: tuple[str | int, ...], field: FieldInfo | None, model: type[BaseModel]
) -> tuple[str, str]:
    """Return key path and message of one error."""
    kind, value, context = details["type"], details["input"], details.get("ctx", {})
    unit = unit_of(field)
    error = context.get("error")
    if isinstance(error, KeyedError):
        return _joined(key_path(loc), error.key), error.message
    if kind in _LENGTH_ERRORS and isinstance(value, (list, tuple)):
        where = loc[:-1] if kind == "missing" else loc
        depth = len(where) - max((i + 1 for i, part in enumerate(where) if isinstance(part, str)), default=0)
        return key_path(where), f"expected {expected(field, depth)}{unit}, got {len(value)}"
    if kind == "missing":
        return key_path(loc), f"missing, expected {expected(field)}{unit}"
    if kind in ("extra_forbidden", "invalid_key"):
        return key_path(loc), f"unknown key '{loc[-1]}'{hint(str(loc[-1]), _siblings(model, loc))}"
    if isinstance(error, Exception):
        return key_path(loc), str(error)
    message = f"{_rule(kind, context, field, unit)}, got {shown(value)}{number_advice(kind, value)}"
    return key_path(loc), message


def _rule(kind: str, context: Mapping[str, Any], field: FieldInfo | None, unit: str) -> str:
    """Say what a value has to be."""
    if kind in _BOUNDS:
        name, sign = _BOUNDS[kind]
        return f"must be {sign} {context[name]:g}{unit}"
    if kind == "finite_number":
        return f"must be a finite number{unit}"
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind in _TYPE_ERRORS:
        return f"expected {TYPE_WORDS[_TYPE_ERRORS[kind]]}{unit}"
    return f"expected {expected(field)}{unit}"


def _siblings(model: type[BaseModel], loc: Sequence[str | int]) -> list[str]:
    """Return the keys that are allowed where an unknown one was found."""
    here = model
    for part in loc[:-1]:
        if isinstance(part, str) and part in here.model_fields:
            here = next((t for t in parts_of(here.model_fields[part].annotation) if is_model(t)), here)
    return list(here.model_fields)
