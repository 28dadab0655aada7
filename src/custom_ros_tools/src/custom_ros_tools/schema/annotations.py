"""Annotations for fields of configuration models, in addition to pydantic's annotations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from custom_ros_tools.errors import Problem


def optional(description: str) -> Any:
    """Makes the model field of an optional key, with the default None."""
    return Field(None, description=description)


@dataclass(frozen=True)
class _Keyword:
    """Base class of annotations that add a text to the JSON Schema, under a keyword that this workspace defines."""

    text: str
    keyword: ClassVar[str]

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(core), self.keyword: self.text}


class Unit(_Keyword):
    """Unit of a number, as in `Annotated[float, Unit("Hz")]`; error messages show the unit in brackets."""

    keyword = "unit"


class Expects(_Keyword):
    """Words that describe the expected value in error messages, for fields whose type does not say enough.

    On the item type of a list, the words have to describe the whole list, since messages show them for the list.
    """

    keyword = "expects"


@dataclass(frozen=True, eq=False)  # typing requires a hash, which a mapping lacks
class AlsoTakes:
    """Annotation with the JSON Schema of values that a validator accepts in addition to values of the field's type."""

    schema: Mapping[str, Any]

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [handler(core), dict(self.schema)]}


@dataclass(eq=False)
class InnerProblemsError(ValueError):
    """A validator has validated a value with another model, and found faults. The keys of `problems` are relative to
    the value.
    """

    problems: Sequence[Problem]


@dataclass(eq=False)
class KeyedError(ValueError):
    """A validator of a whole model has found a fault in one key.

    Attributes:
        key: The key, or a key path such as `primitive.type`, relative to the model.
        message: Description of the fault.
    """

    key: str
    message: str
