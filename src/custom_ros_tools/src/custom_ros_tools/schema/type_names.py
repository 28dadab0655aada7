"""Words for what a field wants and for what it got."""

from __future__ import annotations

import math
import re
import reprlib
import types
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from .annotations import SaysWhatItWants, Unit

TYPE_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "text", dict: "a mapping"}
_REPR = reprlib.Repr()
_REPR.maxlevel = 2  # aliases can make a short YAML text unfold without end


def shown(value: Any) -> str:
    """Return a value as the user would have written it in YAML, shortened."""
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


def is_model(part: Any) -> bool:
    """Tell whether a part of an annotation is a model."""
    return isinstance(part, type) and issubclass(part, BaseModel)


def parts_of(annotation: Any) -> Iterator[Any]:
    """Yield an annotation and everything inside it: metadata, alternatives, item types."""
    yield annotation
    if isinstance(annotation, FieldInfo):
        for extra in annotation.metadata:
            yield from parts_of(extra)
    elif get_origin(annotation) is not Literal:
        for inner in get_args(annotation):
            yield from parts_of(inner)


def unit_of(field: FieldInfo | None) -> str:
    """Return the unit of a field as ` [Hz]`, empty if it has none."""
    if field is None:
        return ""
    if isinstance(field.json_schema_extra, dict) and "unit" in field.json_schema_extra:
        return f" [{field.json_schema_extra['unit']}]"
    units = (part.name for part in [*parts_of(field), *parts_of(field.annotation)] if isinstance(part, Unit))
    return next((f" [{unit}]" for unit in units), "")


def expected(field: FieldInfo | None, depth: int = 0) -> str:
    """Say in words what a field wants.

    Args:
        field: The field.
        depth: How many list indices deep; 1 asks about the items of the field's list.
    """
    if field is None:
        return "another value"
    for part in [*parts_of(field), *parts_of(field.annotation)]:
        if isinstance(part, SaysWhatItWants):
            return part.in_words()
    annotation: Any = field.annotation
    for _ in range(depth):
        annotation = next((get_args(p)[0] for p in parts_of(annotation) if get_origin(p) in (tuple, list)), None)
    return _in_words(annotation)


def _in_words(annotation: Any, plural: bool = False) -> str:
    origin = get_origin(annotation)
    if origin is Annotated:
        return _in_words(get_args(annotation)[0], plural)
    if origin in (Union, types.UnionType):
        return " or ".join(_in_words(a, plural) for a in get_args(annotation) if a is not type(None))
    if origin is Literal:
        return "one of " + ", ".join(map(str, get_args(annotation)))
    if origin in (tuple, list):
        items = get_args(annotation)
        count = "" if Ellipsis in items or origin is list else f"{len(items)} "
        return f"{'lists' if plural else 'a list'} of {count}{_in_words(items[0], plural=True)}"
    singular = "a mapping" if is_model(annotation) or origin is dict else TYPE_WORDS.get(annotation, "a value")
    return singular.removeprefix("a ") + "s" if plural and singular.startswith("a ") else singular


def number_advice(kind: str, value: Any) -> str:
    """Say what to write where YAML took a number for text, as it does with 1e-3."""
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
