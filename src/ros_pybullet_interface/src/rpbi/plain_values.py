"""Converts plain Python data of scripts (mappings, lists and arrays) to named tuples."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeVar, cast

from pydantic import ConfigDict, TypeAdapter, ValidationError

from custom_ros_tools.errors import hint
from custom_ros_tools.schema.errors import key_path
from custom_ros_tools.schema.type_names import shown

Tuple = TypeVar("Tuple", bound=tuple)


def as_tuple(kind: type[Tuple], given: Any) -> Tuple:
    """Converts plain data to an instance of a named-tuple class; returns an instance of the class unchanged.

    Args:
        kind: The named-tuple class.
        given: An instance of `kind`, a mapping from field names to values, or a list of the fields' values. Values may
            be arrays.

    Raises:
        ValueError: If `given` does not fit `kind`, or contains a non-finite number. The message names the field.
    """
    if isinstance(given, kind):
        return given
    plain = _without_arrays(given)
    fields: tuple[str, ...] = cast(Any, kind)._fields
    if not isinstance(plain, Mapping) and not (isinstance(plain, (list, tuple)) and len(plain) <= len(fields)):
        raise ValueError(f"expected a {kind.__name__}, or a mapping with {', '.join(fields)}; got {shown(given)}")
    unknown = [str(key) for key in plain if key not in fields] if isinstance(plain, Mapping) else []
    if unknown:
        raise ValueError(f"unknown key '{unknown[0]}'{hint(unknown[0], fields)}")
    try:
        return _adapter(kind).validate_python(plain)
    except ValidationError as error:
        raise ValueError("; ".join(_message(fields, each) for each in error.errors(include_url=False))) from None


def joint_values(given: Mapping[Any, Any]) -> dict[str, float]:
    """Checks a mapping from joint names to numbers, and returns the numbers as floats.

    Raises:
        ValueError: If a key is not a string, or a value is not a number.
    """
    for name, value in given.items():
        if not isinstance(name, str):
            raise ValueError(f"expected names of joints, got {shown(name)}")
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ValueError(f"expected a number for joint '{name}', got {shown(value)}")
    return {name: float(value) for name, value in given.items()}


@lru_cache(maxsize=100)
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind, config=ConfigDict(allow_inf_nan=False))


def _without_arrays(given: Any) -> Any:
    if hasattr(given, "tolist"):
        return given.tolist()
    if isinstance(given, Mapping):
        return {key: _without_arrays(value) for key, value in given.items()}
    return [_without_arrays(value) for value in given] if type(given) in (list, tuple) else given


def _message(fields: tuple[str, ...], error: Any) -> str:
    first, *rest = error["loc"]
    where = key_path((fields[first] if isinstance(first, int) and first < len(fields) else first, *rest))
    if error["type"].startswith("missing"):
        return f"{where}: missing"
    said = error["msg"][0].lower() + error["msg"][1:]
    return f"{where}: {said}, got {shown(error['input'])}"
