"""Keys of every body in YAML."""

from typing import Annotated, Any

from pydantic import Field, PlainValidator, ValidationInfo, model_validator
from typing_extensions import Self

from custom_ros_tools.schema import ConfigModel, Expects, KeyedError, ListOf, Name
from rpbi.config.sensors import SensorConfig
from rpbi.sensors import SENSOR_TYPES


def _sensor_config(entry: Any, info: ValidationInfo) -> SensorConfig:
    """Parses an entry of `sensors` with the `Config` of the sensor class that the entry names."""
    expected = "a mapping with 'type: module:Class', 'name' and 'hz'"
    return SENSOR_TYPES.parse_entry(entry, info, SensorConfig, expected)


SensorEntry = Annotated[
    Any,
    PlainValidator(_sensor_config, json_schema_input_type=SensorConfig),
    Expects("a list of sensors"),  # error text for the list; the validator reports errors of entries
]
"""A sensor from another package: `{type: module:Class, name: NAME, hz: RATE, KEY: VALUE, ...}`."""


class BodyConfig(ConfigModel):
    """Keys of all objects."""

    name: Name = Field(description="Unique name; topics and TF frames are named after it.")
    sensors: ListOf[SensorEntry] = Field((), description="Sensors of your own on the body.")

    @model_validator(mode="after")
    def _sensors_differ_in_name(self) -> Self:
        names = [sensor.name for sensor in self.sensors]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise KeyedError(f"sensors[{index}].name", f"'{name}' is the name of another sensor of this body")
        return self
