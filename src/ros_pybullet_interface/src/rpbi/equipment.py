"""What a body brings along into a world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .bodies import Body, BodyConfig
from .inputs import Input
from .plugin_faults import blaming
from .plugins import find_class
from .sensors import BodySensor
from .sensors.sensor import Sensor


def equipment(body: Body, config: BodyConfig) -> tuple[tuple[Sensor, ...], Mapping[str, Input]]:
    """Returns the sensors of a body, those of other packages last, and its inputs by name.

    Args:
        body: The body.
        config: Its configuration.

    Raises:
        PluginError: If a class of another package fails.
    """
    with blaming(body, f"sensors and inputs of '{body.name}'"):
        sensors, inputs = body.sensors(), body.inputs()
    return (*sensors, *(_make(body, each) for each in config.sensors)), inputs


def _make(body: Body, config: Any) -> Sensor:
    sensor_class = find_class(config.type, BodySensor)
    with blaming(sensor_class, f"making '{body.name}/{config.name}'"):
        return sensor_class(body, config)
