"""Dynamic objects, which physics moves, except while they follow an up-to-date TF frame."""

from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema import ConfigModel, HzOrOff, NonNegative, Position, PositiveKilograms, Quat
from rpbi.config.contact_presets import WithContactPreset
from rpbi.config.pybullet_models import (
    ChangeDynamics,
    CreateCollisionShape,
    CreateVisualShape,
    ObjectTf,
    ResetBaseVelocity,
)
from rpbi.config.sensors import ContactsConfig
from rpbi.engine.client import Client
from rpbi.sensors.base_state import BaseStateSensor
from rpbi.sensors.contacts.arrows import contact_sensors
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.sensors.sensor import Sensor

from .body_config import BodyConfig
from .shape_object import Decomposition, MaximalCoordinates, ShapeObject


class ContactFriction(ConfigModel):
    """Friction that depends on how many contact points share the load, as that of plastics depends on pressure."""

    edge: NonNegative = Field(description="Coulomb friction coefficient while the object has two contact points.")
    face: NonNegative = Field(description="Coulomb friction coefficient while it has three contact points or more.")


class DynamicObjectConfig(WithContactPreset, BodyConfig):
    """A dynamic object, which physics moves."""

    createVisualShape: CreateVisualShape = Field(description="Visual shape of the object.")
    createCollisionShape: CreateCollisionShape = Field(description="Collision shape of the object.")
    changeDynamics: ChangeDynamics | None = Field(
        None, description="Friction, restitution and other dynamics parameters. By default, PyBullet's values."
    )
    contactFriction: ContactFriction | None = Field(
        None,
        description="Friction on edges and faces; `lateralFriction` is then the friction on a single contact point. By "
        "default, the friction does not depend on the number of contact points.",
    )
    baseMass: PositiveKilograms = Field(description="Mass of the object.")
    basePosition: Position = Field((0.0, 0.0, 0.0), description="Start position in the world.")
    baseOrientation: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Start orientation in the world, x, y, z, w.")
    baseInertialFramePosition: Position = Field(
        (0.0, 0.0, 0.0), description="Centre of mass in the object's frame; not with `useMaximalCoordinates`."
    )
    useMaximalCoordinates: MaximalCoordinates = False
    convexDecomposition: Decomposition = None
    resetBaseVelocity: ResetBaseVelocity | None = Field(
        None, description="Start velocity. By default, the object starts at rest."
    )
    tracked_tf: ObjectTf | None = Field(
        None,
        description="TF frame that the object follows while the frame is up to date; otherwise physics moves the "
        "object. By default, physics always moves the object.",
    )
    broadcast_hz: HzOrOff = Field(0.0, description="Rate of the object's pose on TF; 0 is off.")
    base_state_hz: HzOrOff = Field(0.0, description="Rate of the object's pose and velocity on `base_state`; 0 is off.")
    contacts: ContactsConfig | None = Field(
        None,
        description="Topics with the contacts of the object; `{}` selects the defaults. By default, contacts are not "
        "published.",
    )


class DynamicObject(ShapeObject):
    """An object that physics moves, except while the object follows an up-to-date TF frame."""

    Config = DynamicObjectConfig
    section = "dynamic_objects"
    example = {
        "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "createCollisionShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "baseMass": 1.0,
        "tracked_tf": {"tf_id": "FRAME"},
        "broadcast_hz": 50.0,
        "base_state_hz": 50.0,
        "contacts": {},
    }

    def __init__(self, pb: Client, config: DynamicObjectConfig) -> None:
        if config.useMaximalCoordinates and pb.is_deformable:
            message = "soft bodies have no contacts with bodies in maximal coordinates; remove it in a deformable world"
            raise ConfigError([Problem(config.name, "useMaximalCoordinates", message)])
        if config.useMaximalCoordinates and any(config.baseInertialFramePosition):
            message = "the centre of mass of a body in maximal coordinates is its origin; remove one of the two"
            raise ConfigError([Problem(config.name, "baseInertialFramePosition", message)])
        if config.useMaximalCoordinates and config.tracked_tf is not None:
            message = "a body in maximal coordinates cannot follow TF; remove one of the two"
            raise ConfigError([Problem(config.name, "useMaximalCoordinates", message)])
        super().__init__(
            pb,
            config.name,
            config.createVisualShape,
            config.createCollisionShape,
            config.convexDecomposition,
            baseMass=config.baseMass,
            basePosition=config.basePosition,
            baseOrientation=config.baseOrientation,
            useMaximalCoordinates=config.useMaximalCoordinates,
            **(
                {"baseInertialFramePosition": config.baseInertialFramePosition}
                if any(config.baseInertialFramePosition)
                else {}
            ),
        )
        if config.changeDynamics is not None:
            self.change_dynamics(-1, **config.changeDynamics.kwargs())
        self._start_base(config.resetBaseVelocity)
        self._track(config.tracked_tf)
        self.config = config
        self._corner_friction: float = self.dynamics_info(-1)[1]
        self._present_friction: float | None = None
        """Friction that `before_step` has set last; None if it has to be set again."""

    @property
    def needs_steps(self) -> bool:
        """Whether the friction depends on the contacts, or a derived class acts in each tick."""
        return self.config.contactFriction is not None or type(self).before_step is not DynamicObject.before_step

    def before_step(self, tick: int) -> None:
        """Sets the friction for the number of contact points after the last tick."""
        friction = self.config.contactFriction
        if friction is None:
            return
        points = len(self.pb.getContactPoints(self.body_id))
        wanted = self._corner_friction if points < 2 else friction.edge if points == 2 else friction.face
        if wanted != self._present_friction:
            self.pb.changeDynamics(self.body_id, -1, lateralFriction=wanted)
            self._present_friction = wanted

    def restart(self) -> bool:
        """Returns whether the body's initial state was restored, see `ShapeObject.restart`."""
        self._present_friction = None
        return super().restart()

    def resume(self) -> None:
        """Has the friction set again in another client."""
        self._present_friction = None

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the sensors of the object's pose, base state and contacts, each only if it is configured."""
        frame, config = f"rpbi/{self.name}", self.config
        sensors: list[Sensor] = []
        if config.broadcast_hz:
            sensors.append(LinkPoseSensor(self, config.broadcast_hz, links=False, root_frame=frame))
        if config.base_state_hz:
            sensors.append(BaseStateSensor(self, config.base_state_hz, frame))
        return (*sensors, *contact_sensors(self, config.contacts))
