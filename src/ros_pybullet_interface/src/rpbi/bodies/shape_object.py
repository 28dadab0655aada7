"""Objects with one visual shape and an optional collision shape."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from custom_ros_tools.schema import AlsoTakes, Expects, Fraction, Switch
from rpbi.config.pybullet_models import CreateCollisionShape, CreateVisualShape, PybulletModel
from rpbi.control.pose_follower import TrackedBase
from rpbi.engine.client import Client
from rpbi.meshes.decomposition import convex_parts

from .body import Body

MaximalCoordinates = Annotated[
    Switch,
    Field(
        description="Whether PyBullet's solver of rigid bodies moves the object. Between two such objects, friction "
        "is the same in all directions; see docs/physics.md."
    ),
]


class ConvexDecomposition(PybulletModel):
    """Parameters of V-HACD, which divides a concave mesh into convex parts; each part collides as its convex hull."""

    resolution: Annotated[int, Field(ge=10_000, le=64_000_000)] = Field(
        100_000,
        description="Number of voxels that represent the mesh. A larger number preserves finer details but takes "
        "longer.",
    )
    concavity: Fraction = Field(0.0025, description="Largest concavity of a part; a smaller value makes more parts.")
    maxNumVerticesPerCH: Annotated[int, Field(ge=4, le=1024)] = Field(
        64, description="Largest number of vertices of a part."
    )
    minVolumePerCH: Annotated[float, Field(ge=0.0, le=0.01)] = Field(
        0.0001, description="Least volume of a part, as a fraction of the mesh's volume."
    )


def _of_a_switch(given: Any) -> Any:
    return given if not isinstance(given, bool) else {} if given else None


Decomposition = Annotated[
    ConvexDecomposition | None,
    BeforeValidator(_of_a_switch),
    AlsoTakes({"type": "boolean"}),
    Expects("true, false or a mapping"),
    Field(
        description="Whether the mesh collides as several convex parts instead of one convex hull: true, or "
        "parameters of V-HACD."
    ),
]


class ShapeObject(Body):
    """An object whose shape comes from `createVisualShape` and `createCollisionShape`.

    Args:
        collision: Collision shape; None for an object without contacts.
        decomposition: How to divide the collision mesh into convex parts; None for a single convex hull.
        multi_body: Further arguments of `createMultiBody`; without `baseMass`, the body is static.

    Raises:
        PhysicsError: If PyBullet does not create the body.
    """

    def __init__(
        self,
        pb: Client,
        name: str,
        visual: CreateVisualShape,
        collision: CreateCollisionShape | None = None,
        decomposition: ConvexDecomposition | None = None,
        **multi_body: Any,
    ) -> None:
        multi_body["baseVisualShapeIndex"] = pb.createVisualShape(**visual.kwargs())
        if collision is not None:
            arguments = collision.kwargs()
            if decomposition is not None:
                arguments["fileName"] = convex_parts(arguments["fileName"], decomposition.model_dump())
            multi_body["baseCollisionShapeIndex"] = pb.createCollisionShape(**arguments)
        super().__init__(pb, name, pb.createMultiBody(**multi_body))
        self.visual = visual

    def restart(self) -> bool:
        """Returns True, since PyBullet has restored the body's whole state.

        Returns False for a body that physics moves while its TF frame is out of date; the caller creates that body
        anew.
        """
        return not isinstance(self.pose_follower, TrackedBase)
