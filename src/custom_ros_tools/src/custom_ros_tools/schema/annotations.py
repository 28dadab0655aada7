"""What the fields of a configuration model may be annotated with, beside pydantic's own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from custom_ros_tools.errors import Problem


def optional(description: str) -> Any:
    """Returns the field of a key that may be left out and then is None."""
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
    """Says in words what a value has to be, where its type does not; of items of a list, what the list has to be."""

    keyword = "expects"


@dataclass(frozen=True, eq=False)  # typing wants a hash, which a mapping has not
class AlsoTakes:
    """Annotation that states, by its JSON Schema, what a validator accepts beside the type itself."""

    schema: Mapping[str, Any]

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [handler(core), dict(self.schema)]}


@dataclass(eq=False)
class InnerProblemsError(ValueError):
    """What a validator raises for a value that has a model of its own; the keys of the problems are inside of it."""

    problems: Sequence[Problem]


@dataclass(eq=False)
class KeyedError(ValueError):
    """What a validator of a whole model raises, to blame one of its keys, or a key path inside of it."""

    key: str
    message: str
