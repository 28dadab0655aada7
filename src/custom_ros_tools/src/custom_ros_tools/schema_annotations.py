"""What the fields of a configuration model may be annotated with, beside pydantic's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema


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


@runtime_checkable
class SaysWhatItWants(Protocol):
    """Annotation that knows the words for "expected ..."; they go before those for the Python type."""

    def in_words(self) -> str:
        """Return what a value has to be, such as `"a file name"`."""


@dataclass(frozen=True)
class Expects:
    """Annotation that says in words what a value has to be, where the Python type does not tell it."""

    text: str

    def in_words(self) -> str:
        """Return the text."""
        return self.text


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
