"""What YAML says of controllers."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainValidator, ValidationInfo, WithJsonSchema

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.schema import InnerProblemsError, KeyedError, Text
from custom_ros_tools.schema.type_names import shown
from rpbi.plugins import config_of

from . import CONTROLLERS, controller_class
from .cartesian_impedance import CartesianImpedanceConfig
from .controller import ControllerConfig
from .force import ForceConfig
from .joint_impedance import JointImpedanceConfig


def controller_config(entry: Any, info: ValidationInfo) -> ControllerConfig:
    """Returns the configuration of a controller, by the model of its class."""
    if isinstance(entry, ControllerConfig):
        return entry
    kind = entry.get("type") if isinstance(entry, Mapping) else None
    if not isinstance(kind, str):
        known = ", ".join(CONTROLLERS)
        raise ValueError(f"expected a mapping with 'type', one of {known}, or module:Class; got {shown(entry)}")
    try:
        model = config_of(controller_class(kind), ControllerConfig)
    except ValueError as error:
        raise KeyedError("type", str(error)) from None
    context = info.context or {}
    try:
        return model.parse(entry, context.get("file", ""), context)
    except ConfigError as error:
        raise InnerProblemsError(error.problems) from None


class OwnControllerConfig(ControllerConfig):
    """An entry with a class of another package, which may have more keys."""

    model_config = ConfigDict(json_schema_extra={"additionalProperties": True})

    type: Annotated[Text, WithJsonSchema({"type": "string", "pattern": ":"})] = Field(description="`module:Class`.")


_Entry = JointImpedanceConfig | CartesianImpedanceConfig | ForceConfig | OwnControllerConfig
ControllerEntry = Annotated[Any, PlainValidator(controller_config, json_schema_input_type=_Entry)]
"""A controller: `{type: KEY or module:Class, KEY: VALUE, ...}`."""
