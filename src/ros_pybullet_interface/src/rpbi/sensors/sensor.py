"""Base classes of sensors, and protocols of the objects that sensors read."""

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
    """The attributes of a `Body` that sensors use."""

    pb: Client
    name: str
    body_id: int
    root_link: str
    dynamics_changes: int

    @property
    def external_wrenches(self) -> ExternalWrenches:
        """External forces and torques on the body's links."""

    @property
    def link_indices(self) -> tuple[int, ...]:
        """PyBullet's indices of all links except the root."""

    def link_name(self, index: int) -> str:
        """Returns the name of the link with a given PyBullet index; -1 is the root."""

    def dynamics_info(self, link: int) -> tuple[Any, ...]:
        """Returns the result of PyBullet's `getDynamicsInfo` for the link with PyBullet's index `link`."""

    def base_pose(self) -> Pose:
        """Returns the pose of the root link's URDF frame in the world frame."""

    def base_twist(self) -> Twist:
        """Returns the twist of the root link's URDF frame, in the axes of the world frame."""

    def state(self) -> BodyState:
        """Returns the pose and joint positions for the renderer process; for soft bodies, also the nodes' positions."""


class SensedRobot(SensedBody, Protocol):
    """The attributes of a `JointedBody` that sensors use."""

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints, including fixed joints, in the order of PyBullet's joint indices."""

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motor efforts [N m or N] of all joints; corrects efforts that PyBullet reports wrongly.

        Args:
            reported: Efforts that PyBullet reports for all joints.
        """


class SensedWorld(Protocol):
    """The attributes of a `World` that sensors use."""

    pb: Client
    clock: Clock

    @property
    def bodies(self) -> Mapping[str, Any]:
        """All bodies, indexed by name."""

    @property
    def cameras(self) -> Mapping[str, Any]:
        """All cameras (`RgbdSensor`), indexed by name."""

    @property
    def contacts(self) -> Any:
        """The `ContactReader`, which returns the contacts of all bodies."""

    @property
    def attachments(self) -> Any:
        """The `Attachments` between bodies."""


class Sensor(ABC):
    """Reads a quantity of the world when the world calls `read`; a sensor does not have its own timer or thread.

    Attributes:
        name: Name in topics: the name of the body or camera, or a text such as `BODY/SENSOR` or `BODY/JOINT`.
        hz: Rate [Hz] in the world's time; 0 is off. The world may change this rate.
        wanted: Whether the samples have receivers; without receivers, the sensor is not read.
    """

    wanted: bool = True
    sample_type: ClassVar[type]
    """Type of the samples that `read` returns."""
    keeps_state: ClassVar[bool] = True
    """Whether samples depend on more than the present state of the world, for instance on earlier ticks."""
    ros_topic: ClassVar[str | None] = ""
    """Module and variable of the sensor's `Topic`, as `module:NAME`.

    With an empty text, the sensor uses the topic of this package's sensor with the same type of samples. None means
    that the sensor has no topic.
    """
    tf_frames: tuple[str, ...] = ()
    """TF frames that the sensor publishes, without prefix."""
    not_in_keyframes: ClassVar[tuple[str, ...]] = ("wanted",)
    """Attributes that keyframes leave out, since they are not part of the world's state."""
    topic: str | None = None
    """Name of the topic, if it differs from the name in the `Topic` of `ros_topic`."""

    def __init__(self, name: str, hz: float) -> None:
        self.name = name
        self.hz = hz

    def enter(self, world: SensedWorld) -> None:  # noqa: B027 (most sensors need nothing but their body)
        """Receives the sensor's world before the first call of `read`; does nothing by default."""

    @abstractmethod
    def read(self, tick: int) -> Any:
        """Returns a sample of the world at `tick`; None if the sensor has no sample yet.

        Raises:
            PhysicsError: If a number in the sample is not finite.
        """

    def before_step(self, tick: int) -> None:  # noqa: B027 (most sensors need nothing)
        """Called before the physics of each tick, whether the sensor is due or not; does nothing by default."""

    def after_step(self, tick: int) -> None:  # noqa: B027
        """Called after the physics of each tick, before sensors are read; does nothing by default."""

    def inputs(self) -> Mapping[str, Input]:
        """Returns the inputs of the sensor, indexed by name; by default an empty mapping."""
        return {}


class BodySensor(Sensor):
    """Base class of sensors that can be listed under the key `sensors` in any body's YAML.

    To add a type of sensor, write a subclass with `Config`, `sample_type` and `read`; see docs/extending.md.
    """

    Config: ClassVar[type[SensorConfig]] = SensorConfig

    def __init__(self, body: Any, config: Any) -> None:
        super().__init__(f"{body.name}/{config.name}", config.hz)
        self.body = body
        self.config = config
