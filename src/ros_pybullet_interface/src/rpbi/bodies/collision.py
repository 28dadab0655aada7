"""Collision objects, which have contacts, and follow a TF frame or stay in place."""

from pydantic import Field

from custom_ros_tools.schema import Position, Quat
from rpbi.config.pybullet_models import ChangeDynamics, CreateCollisionShape, CreateVisualShape, ObjectTf
from rpbi.config.sensors import ContactsConfig
from rpbi.engine.client import Client
from rpbi.sensors.contacts.arrows import contact_sensors
from rpbi.sensors.sensor import Sensor

from .body_config import BodyConfig
from .shape_object import Decomposition, MaximalCoordinates, ShapeObject


class CollisionObjectConfig(BodyConfig):
    """A collision object, which has contacts, and follows a TF frame or stays in place."""

    createVisualShape: CreateVisualShape = Field(description="Visual shape of the object.")
    createCollisionShape: CreateCollisionShape = Field(description="Collision shape of the object.")
    changeDynamics: ChangeDynamics | None = Field(
        None, description="Friction, restitution and other dynamics parameters. By default, PyBullet's values."
    )
    basePosition: Position = Field(
        (0.0, 0.0, 0.0), description="Position in the world; with `object_tf`, until the first pose arrives from TF."
    )
    baseOrientation: Quat = Field(
        (0.0, 0.0, 0.0, 1.0),
        description="Orientation in the world, x, y, z, w; with `object_tf`, until the first pose arrives from TF.",
    )
    useMaximalCoordinates: MaximalCoordinates = False
    convexDecomposition: Decomposition = None
    object_tf: ObjectTf | None = Field(
        None, description="TF frame that the object follows. By default, the object stays in place."
    )
    contacts: ContactsConfig | None = Field(
        None,
        description="Topics with the contacts of the object; `{}` selects the defaults. By default, contacts are not "
        "published.",
    )


class CollisionObject(ShapeObject):
    """An object of infinite mass that follows a TF frame or stays in place."""

    Config = CollisionObjectConfig
    section = "collision_objects"
    example = {
        "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "createCollisionShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "contacts": {},
        "object_tf": {"tf_id": "FRAME"},
    }

    def __init__(self, pb: Client, config: CollisionObjectConfig) -> None:
        super().__init__(
            pb,
            config.name,
            config.createVisualShape,
            config.createCollisionShape,
            config.convexDecomposition,
            basePosition=config.basePosition,
            baseOrientation=config.baseOrientation,
            useMaximalCoordinates=config.useMaximalCoordinates,
        )
        self._follow(config.object_tf)
        if config.changeDynamics is not None:
            self.change_dynamics(-1, **config.changeDynamics.kwargs())
        self._contacts = config.contacts

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the contact sensors, if they are configured."""
        return contact_sensors(self, self._contacts)
