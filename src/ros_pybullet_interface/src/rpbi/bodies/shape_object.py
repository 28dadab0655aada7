"""Objects made of one visual and perhaps one collision shape."""

from typing import Annotated, Any

from pydantic import Field

from custom_ros_tools.schema import Switch
from rpbi.config.pybullet_models import CreateCollisionShape, CreateVisualShape
from rpbi.engine.client import Client

from .body import Body

MaximalCoordinates = Annotated[
    Switch,
    Field(
        description="Whether the solver of rigid bodies moves it; between two such objects friction is the same in all "
        "directions, see docs/physics.md."
    ),
]


class ShapeObject(Body):
    """An object whose shape comes from `createVisualShape` and `createCollisionShape`.

    Args:
        collision: Collision shape, None for an object that nothing can touch.
        multi_body: Other arguments of `createMultiBody`; without `baseMass` it stays whatever pushes it.

    Raises:
        PhysicsError: If PyBullet refuses.
    """

    def __init__(
        self,
        pb: Client,
        name: str,
        visual: CreateVisualShape,
        collision: CreateCollisionShape | None = None,
        **multi_body: Any,
    ) -> None:
        multi_body["baseVisualShapeIndex"] = pb.createVisualShape(**visual.kwargs())
        if collision is not None:
            multi_body["baseCollisionShapeIndex"] = pb.createCollisionShape(**collision.kwargs())
        super().__init__(pb, name, pb.createMultiBody(**multi_body))
        self.visual = visual
