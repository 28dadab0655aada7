"""What the fields of a configuration model may be annotated with, beside pydantic's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

from custom_ros_tools.errors import Problem


@dataclass(frozen=True)
class Unit:
    """Annotation that states the unit of a number, as in `Annotated[float, Unit("Hz")]`.

    Error messages show it in brackets and the JSON Schema carries it under `unit`.
    """

    name: str

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core)
        schema["unit"] = self.name
        return schema


@dataclass(frozen=True, eq=False)  # typing wants a hash, which a mapping has not
class AlsoTakes:
    """Annotation that states what a validator accepts beside the type itself.

    Attributes:
        schema: The JSON Schema of it.
    """

    schema: Mapping[str, Any]

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [handler(core), dict(self.schema)]}


@runtime_checkable
class SaysWhatItWants(Protocol):
    """Annotation that knows the words for "expected ..."; they go before those for the Python type."""

    def in_words(self) -> str:
        """Return what a value has to be, such as `"a file name"`."""


@dataclass(frozen=True)
class Expects:
    """Annotation that says in words what a value has to be, where the Python type does not tell it.

    The JSON Schema carries it under `expects`.
    """

    text: str

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core)
        schema["expects"] = self.text
        return schema

    def in_words(self) -> str:
        """Return the text."""
        return self.text


class InnerProblemsError(ValueError):
    """What a validator raises for a value that has a model of its own.

    Args:
        problems: All that is wrong with the value, with keys inside of it.
    """

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)


class KeyedError(ValueError):
    """What a validator of a whole model raises, to blame one of its keys.

    Args:
        key: Key path inside the model.
        message: What is wrong with it.
    """

    def __init__(self, key: str, message: str) -> None:
        self.key = key
        self.message = message
        super().__init__(key, message)
