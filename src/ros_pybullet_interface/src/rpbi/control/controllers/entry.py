"""What YAML says of controllers."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainValidator, ValidationInfo, WithJsonSchema

from custom_ros_tools.schema import Text
from rpbi.plugins import entry_config

from . import CONTROLLERS, controller_class
from .cartesian_impedance import CartesianImpedanceConfig
from .controller import ControllerConfig
from .force import ForceConfig
from .joint_impedance import JointImpedanceConfig


def controller_config(entry: Any, info: ValidationInfo) -> ControllerConfig:
    """Returns the configuration of a controller, by the model of its class."""
    expected = f"a mapping with 'type', one of {', '.join(CONTROLLERS)}, or module:Class"
    return entry_config(entry, info, ControllerConfig, controller_class, expected)


class OwnControllerConfig(ControllerConfig):
    """An entry with a class of another package, which may have more keys."""

    model_config = ConfigDict(json_schema_extra={"additionalProperties": True})

    type: Annotated[Text, WithJsonSchema({"type": "string", "pattern": ":"})] = Field(description="`module:Class`.")


_Entry = JointImpedanceConfig | CartesianImpedanceConfig | ForceConfig | OwnControllerConfig
ControllerEntry = Annotated[Any, PlainValidator(controller_config, json_schema_input_type=_Entry)]
"""A controller: `{type: KEY or module:Class, KEY: VALUE, ...}`."""
