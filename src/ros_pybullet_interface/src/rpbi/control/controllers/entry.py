"""Entries of controllers in YAML."""

from typing import Annotated, Any, Union

from pydantic import ConfigDict, Field, PlainValidator, ValidationInfo, WithJsonSchema

from custom_ros_tools.schema import Text

from . import CONTROLLERS
from .controller import ControllerConfig


def controller_config(entry: Any, info: ValidationInfo) -> ControllerConfig:
    """Returns the configuration of a controller, by the model of its class."""
    expected = f"a mapping with 'type', one of {', '.join(CONTROLLERS)}, or module:Class"
    return CONTROLLERS.parse_entry(entry, info, ControllerConfig, expected)


class OwnControllerConfig(ControllerConfig):
    """An entry with a class of another package, which may have more keys."""

    model_config = ConfigDict(json_schema_extra={"additionalProperties": True})

    type: Annotated[Text, WithJsonSchema({"type": "string", "pattern": ":"})] = Field(description="`module:Class`.")


_Entry: Any = Union[(*CONTROLLERS.configs().values(), OwnControllerConfig)]  # noqa: UP007 (known at run time only)
ControllerEntry = Annotated[Any, PlainValidator(controller_config, json_schema_input_type=_Entry)]
"""A controller: `{type: KEY or module:Class, KEY: VALUE, ...}`."""
