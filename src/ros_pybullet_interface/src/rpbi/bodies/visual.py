"""Visual objects, which are visible but have no contacts."""

from pydantic import Field

from custom_ros_tools.schema import Position, Quat
from rpbi.config.pybullet_models import CreateCollisionShape, CreateVisualShape, ObjectTf
from rpbi.engine.client import Client

from .body_config import BodyConfig
from .shape_object import ShapeObject


class VisualObjectConfig(BodyConfig):
    """A visual object, which is visible but has no contacts."""

    createVisualShape: CreateVisualShape = Field(description="Visual shape of the object.")
    createCollisionShape: CreateCollisionShape | None = Field(
        None,
        description="Accepted without effect, so that the file of a collision object can also be used for a visual "
        "object.",
    )
    basePosition: Position = Field(
        (0.0, 0.0, 0.0), description="Position in the world; with `object_tf`, until the first pose arrives from TF."
    )
    baseOrientation: Quat = Field(
        (0.0, 0.0, 0.0, 1.0),
        description="Orientation in the world, x, y, z, w; with `object_tf`, until the first pose arrives from TF.",
    )
    object_tf: ObjectTf | None = Field(
        None, description="TF frame that the object follows. By default, the object stays in place."
    )


class VisualObject(ShapeObject):
    """An object without collision shape that follows a TF frame or stays in place."""

    Config = VisualObjectConfig
    section = "visual_objects"
    has_physics = False
    example = {"createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}, "object_tf": {"tf_id": "FRAME"}}

    def __init__(self, pb: Client, config: VisualObjectConfig) -> None:
        super().__init__(
            pb,
            config.name,
            config.createVisualShape,
            basePosition=config.basePosition,
            baseOrientation=config.baseOrientation,
        )
        self.object_tf = config.object_tf
