"""Base classes of sensors, and what they read of the world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol

from rpbi.config.sensors import SensorConfig
from rpbi.control.external_wrenches import ExternalWrenches
from rpbi.engine.client import Client
from rpbi.engine.clock import Clock
from rpbi.engine.inputs import Input
from rpbi.geometry import Pose, Twist
from rpbi.samples import BodyState
from rpbi.urdf.joints import Joint


class SensedBody(Protocol):
    """A `Body`."""

    pb: Client
    name: str
    body_id: int
    root_link: str
    dynamics_changes: int

    @property
    def external_wrenches(self) -> ExternalWrenches:
        """Forces and torques on its links from outside."""

    @property
    def link_indices(self) -> tuple[int, ...]:
        """PyBullet's indices of all links but the root."""

    def link_name(self, index: int) -> str:
        """Returns the name of a link."""

    def dynamics_info(self, link: int) -> tuple[Any, ...]:
        """Returns PyBullet's dynamics of a link."""

    def base_pose(self) -> Pose:
        """Returns the pose of the root link's URDF frame in the world."""

    def base_twist(self) -> Twist:
        """Returns the twist of the root link in the world."""

    def state(self) -> BodyState:
        """Returns all that the renderer needs."""


class SensedRobot(SensedBody, Protocol):
    """A `JointedBody`."""

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints, fixed ones included, in PyBullet's order."""

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motor efforts [N m or N] of all joints by what PyBullet reports."""


class SensedWorld(Protocol):
    """A `World`."""

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
        """Contacts of all bodies, a `ContactReader`."""

    @property
    def attachments(self) -> Any:
        """Attachments between bodies, an `Attachments`."""


class Sensor(ABC):
    """Reads a quantity from the world at a rate; it has no timer or thread of its own.

    Attributes:
        name: The body or sensor that its topics are named after.
        hz: Rate [Hz] of the world's time, 0 is never; the world changes it.
        wanted: Whether its samples have receivers; without any, it is not read.
    """

    wanted: bool = True
    sample_type: ClassVar[type]
    """Type of its samples."""
    keeps_state: ClassVar[bool] = True
    """Whether its samples depend on more than the present state of the world, such as earlier ticks."""
    ros_topic: ClassVar[str | None] = ""
    """Place of its `Topic`, as `module:NAME`.

    Empty stands for the topic of the sensors of this package with the same type of samples, None for no topic.
    """
    tf_frames: tuple[str, ...] = ()
    """TF frames that it publishes, without prefix."""
    not_in_keyframes: ClassVar[tuple[str, ...]] = ("wanted",)
    """Attributes that are no part of the world's state."""
    topic: str | None = None
    """Name of its topic, if it differs from that of its `Topic`."""

    def __init__(self, name: str, hz: float) -> None:
        self.name = name
        self.hz = hz

    def enter(self, world: SensedWorld) -> None:  # noqa: B027 (most sensors need nothing but their body)
        """Enters its world, before it is read for the first time."""

    @abstractmethod
    def read(self, tick: int) -> Any:
        """Returns a sample of the world at `tick`, None if there is none yet.

        Raises:
            PhysicsError: If the world holds something that is not finite.
        """

    def before_step(self, tick: int) -> None:  # noqa: B027 (most sensors need nothing)
        """Called just before the physics of each tick, whether the sensor is due or not."""

    def after_step(self, tick: int) -> None:  # noqa: B027
        """Called just after the physics of each tick, before sensors are read."""

    def inputs(self) -> Mapping[str, Input]:
        """Returns the inputs of the sensor by name."""
        return {}


class BodySensor(Sensor):
    """A sensor that any body can have in its `sensors`.

    A new one is a subclass with a `Config`, a `sample_type` and `read`; see docs/extending.md.
    """

    Config: ClassVar[type[SensorConfig]] = SensorConfig

    def __init__(self, body: Any, config: Any) -> None:
        super().__init__(f"{body.name}/{config.name}", config.hz)
        self.body = body
        self.config = config
