"""Sensors that a body's YAML asks for by `module:Class`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from rpbi.config.sensors import SensorConfig

from .sensor import Sensor

if TYPE_CHECKING:
    from rpbi.bodies.body import Body  # whose configuration asks for this class


class BodySensor(Sensor):
    """A sensor of another package, on a body.

    A new one is a subclass with a `Config`, a `sample_type` and `read`; see docs/extending.md.
    """

    Config: ClassVar[type[SensorConfig]] = SensorConfig

    def __init__(self, body: Body, config: Any) -> None:
        super().__init__(f"{body.name}/{config.name}", config.hz)
        self.body = body
        self.config = config
