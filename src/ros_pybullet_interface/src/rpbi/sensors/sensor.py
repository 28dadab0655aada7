"""What every sensor has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from rpbi.config.sensors import SensorConfig
from rpbi.engine.client import Client
from rpbi.engine.clock import Clock
from rpbi.engine.inputs import Input


class SensedWorld(Protocol):
    """What a sensor may ask of its world, which is a `World`."""

    pb: Client
    clock: Clock

    @property
    def bodies(self) -> Mapping[str, Any]:
        """All bodies by name."""

    @property
    def cameras(self) -> Mapping[str, Any]:
        """All cameras by name, each an `RgbdSensor`."""

    @property
    def contacts(self) -> Any:
        """Who touches whom, a `ContactReader`."""

    @property
    def attachments(self) -> Any:
        """Who holds whom, `Attachments`."""


class Sensor(ABC):
    """Reads something from the world at a rate; it owns neither timer nor thread.

    Attributes:
        name: The body or sensor that its topics are named after.
        hz: How often it is read [Hz] of the world's time, 0 is never; the world changes it.
        wanted: Whether anybody looks at its samples; it is not read while nobody does.
    """

    wanted: bool = True
    sample_type: ClassVar[type]
    """The type of its samples, by which their topic is found."""
    ros_topic: ClassVar[str] = ""
    """Where to find the topic of a sensor from another package, a Topic, as `module:NAME`."""
    topic: str | None = None
    """Name of its topic, where it is not the one that the Topic has."""

    def __init__(self, name: str, hz: float) -> None:
        self.name = name
        self.hz = hz

    def enter(self, world: SensedWorld) -> None:  # noqa: B027 (most sensors need nothing but their body)
        """Gets to know the world that it is in, before it is read for the first time."""

    @abstractmethod
    def read(self, tick: int) -> Any:
        """Returns a sample of the world at `tick`, None if there is nothing to tell yet.

        Raises:
            PhysicsError: If the world holds something that is not finite.
        """

    def before_step(self, tick: int) -> None:  # noqa: B027 (most sensors need nothing)
        """Acts just before the physics of each tick, due or not; sensors that need nothing leave it."""

    def after_step(self, tick: int) -> None:  # noqa: B027
        """Acts just after the physics of each tick, before sensors are read."""

    def inputs(self) -> Mapping[str, Input]:
        """Returns what the sensor takes while the world runs, by name."""
        return {}


class BodySensor(Sensor):
    """A sensor of another package, on a body.

    A new one is a subclass with a `Config`, a `sample_type` and `read`; see docs/extending.md.
    """

    Config: ClassVar[type[SensorConfig]] = SensorConfig

    def __init__(self, body: Any, config: Any) -> None:
        super().__init__(f"{body.name}/{config.name}", config.hz)
        self.body = body
        self.config = config
