"""Annotations for the fields of a configuration model, in addition to pydantic's own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from custom_ros_tools.errors import Problem


def optional(description: str) -> Any:
    """Returns the field of an optional key, whose default is None."""
    return Field(None, description=description)


@dataclass(frozen=True)
class _Keyword:
    """Annotation that adds a text to the JSON Schema, under a keyword of ours."""

    text: str
    keyword: ClassVar[str]

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(core), self.keyword: self.text}


class Unit(_Keyword):
    """States the unit of a number, as in `Annotated[float, Unit("Hz")]`; error messages show it in brackets."""

    keyword = "unit"


class Expects(_Keyword):
    """Describes the expected value in words, where its type does not; for items of a list, the expected list."""

    keyword = "expects"


@dataclass(frozen=True, eq=False)  # typing requires a hash, which a mapping lacks
class AlsoTakes:
    """Annotation with the JSON Schema of further values that a validator accepts, in addition to the type itself."""

    schema: Mapping[str, Any]

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [handler(core), dict(self.schema)]}


@dataclass(eq=False)
class InnerProblemsError(ValueError):
    """Raised by a validator for a value that has a model of its own; the keys of the problems are relative to the
    value.
    """

    problems: Sequence[Problem]


@dataclass(eq=False)
class KeyedError(ValueError):
    """Raised by a validator of a whole model to report one of its keys, or a key path inside of it."""

    key: str
    message: str
