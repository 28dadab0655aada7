"""What YAML may hand to PyBullet's functions about bodies; each model is named after the function.

The fields are the function's keyword arguments, less those that name the body. A test asks PyBullet whether
it takes each of them, with values of that type.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from custom_ros_tools.schema import (
    AlsoTakes,
    ConfigModel,
    Count,
    Direction,
    Expects,
    FrameId,
    Hz,
    KeyedError,
    Kilograms,
    ListOf,
    Metres,
    NonNegative,
    Position,
    Positive,
    PositiveMetres,
    Quat,
    Rgb,
    Rgba,
    Switch,
    Unit,
    Vec3,
)

from .asset_files import ExistingFile, RobotFile
from .pybullet_args import (
    ACTIVATION_STATES,
    COLLISION_SHAPE_FLAGS,
    CONTROL_MODES,
    SHAPE_TYPES,
    URDF_FLAGS,
    VISUAL_SHAPE_FLAGS,
)

HalfExtents = Annotated[tuple[PositiveMetres, PositiveMetres, PositiveMetres], Field(strict=False)]


def _one_as_list(given: Any) -> Any:
    return [given] if isinstance(given, (int, float)) and not isinstance(given, bool) else given


Gains = Annotated[
    Annotated[ListOf[NonNegative], Tag("list")] | Annotated[dict[str, NonNegative], Tag("mapping")],
    Discriminator(lambda given: "mapping" if isinstance(given, Mapping) else "list"),
    BeforeValidator(_one_as_list),
    AlsoTakes({"type": "number", "minimum": 0}),
    Expects("a number, a list of numbers or a mapping of joints to numbers"),
]
"""One gain for all joints, one for each, or some by joint."""


class PybulletModel(ConfigModel):
    """Keyword arguments of one PyBullet function."""

    def kwargs(self) -> dict[str, Any]:
        """Return the arguments that the user wrote, with constants as numbers."""
        return self.model_dump(exclude_unset=True, exclude_none=True)


class LoadURDF(PybulletModel):
    """Where a robot description is and how it is put into the world."""

    fileName: RobotFile = Field(description="URDF file, or the word `robot_description` for the parameter.")
    basePosition: Position | None = Field(None, description="Position of the base in the world.")
    baseOrientation: Quat | None = Field(None, description="Orientation of the base in the world as x, y, z, w.")
    useFixedBase: Switch | None = Field(None, description="Whether the base is fixed to the world.")
    useMaximalCoordinates: Switch | None = Field(None, description="Whether joints are solved as constraints.")
    flags: Annotated[int, URDF_FLAGS] | None = Field(None, description="URDF_... flags.")
    globalScaling: Positive | None = Field(None, description="Factor on all lengths.")


class CreateVisualShape(PybulletModel):
    """What an object looks like."""

    shapeType: Annotated[int, SHAPE_TYPES] = Field(description="GEOM_... constant.")
    radius: PositiveMetres | None = Field(None, description="Radius of a sphere, capsule or cylinder.")
    halfExtents: HalfExtents | None = Field(None, description="Half the edge lengths of a box.")
    length: PositiveMetres | None = Field(None, description="Length of a capsule or cylinder.")
    fileName: ExistingFile | None = Field(None, description="Mesh file.")
    meshScale: Vec3 | None = Field(None, description="Factors on a mesh along x, y and z.")
    planeNormal: Direction | None = Field(None, description="Normal of a plane.")
    flags: Annotated[int, VISUAL_SHAPE_FLAGS] | None = Field(None, description="VISUAL_SHAPE_... flags.")
    rgbaColor: Rgba | None = Field(None, description="Colour and opacity, each from 0 to 1.")
    specularColor: Rgb | None = Field(None, description="Colour of highlights, each from 0 to 1.")
    visualFramePosition: Position | None = Field(None, description="Position of the shape in the body's frame.")
    visualFrameOrientation: Quat | None = Field(None, description="Orientation in the body's frame as x, y, z, w.")
    vertices: ListOf[Position] | None = Field(None, description="Corners of a mesh that has no file.")
    indices: ListOf[Count] | None = Field(None, description="Corner numbers of its triangles.")
    normals: ListOf[Vec3] | None = Field(None, description="Normals at its corners.")
    uvs: ListOf[Annotated[tuple[float, float], Field(strict=False)]] | None = Field(
        None, description="Texture coordinates at its corners."
    )

    @model_validator(mode="after")
    def _mesh_has_a_source(self) -> CreateVisualShape:
        _require(self, "GEOM_MESH", "fileName", "vertices")
        return self


class CreateCollisionShape(PybulletModel):
    """What an object feels like."""

    shapeType: Annotated[int, SHAPE_TYPES] = Field(description="GEOM_... constant.")
    radius: PositiveMetres | None = Field(None, description="Radius of a sphere, capsule or cylinder.")
    halfExtents: HalfExtents | None = Field(None, description="Half the edge lengths of a box.")
    height: PositiveMetres | None = Field(None, description="Length of a capsule or cylinder.")
    fileName: ExistingFile | None = Field(None, description="Mesh or height field file.")
    meshScale: Vec3 | None = Field(None, description="Factors on a mesh along x, y and z.")
    planeNormal: Direction | None = Field(None, description="Normal of a plane.")
    flags: Annotated[int, COLLISION_SHAPE_FLAGS] | None = Field(None, description="GEOM_... flags.")
    collisionFramePosition: Position | None = Field(None, description="Position of the shape in the body's frame.")
    collisionFrameOrientation: Quat | None = Field(None, description="Orientation in the body's frame as x, y, z, w.")
    vertices: ListOf[Position] | None = Field(None, description="Corners of a mesh that has no file.")
    indices: ListOf[Count] | None = Field(None, description="Corner numbers of its triangles.")
    heightfieldTextureScaling: Positive | None = Field(None, description="Repetitions of a height field's texture.")
    heightfieldData: ListOf[Metres] | None = Field(None, description="Heights, row by row.")
    numHeightfieldRows: Count | None = Field(None, description="Rows of the height field.")
    numHeightfieldColumns: Count | None = Field(None, description="Columns of the height field.")

    @model_validator(mode="after")
    def _mesh_has_a_source(self) -> CreateCollisionShape:
        _require(self, "GEOM_MESH", "fileName", "vertices")
        _require(self, "GEOM_HEIGHTFIELD", "fileName", "heightfieldData")
        return self


class ChangeDynamics(PybulletModel):
    """How a body behaves in contact and motion."""

    mass: Kilograms | None = Field(None, description="Mass of the base link.")
    lateralFriction: NonNegative | None = Field(None, description="Coulomb friction coefficient.")
    spinningFriction: NonNegative | None = Field(None, description="Friction about the contact normal.")
    rollingFriction: NonNegative | None = Field(None, description="Friction against rolling.")
    restitution: NonNegative | None = Field(None, description="Bounciness; 0 does not bounce, 1 keeps all energy.")
    linearDamping: NonNegative | None = Field(None, description="Share of linear velocity lost.")
    angularDamping: NonNegative | None = Field(None, description="Share of angular velocity lost.")
    contactStiffness: Annotated[NonNegative, Unit("N/m")] | None = Field(None, description="Stiffness of contacts.")
    contactDamping: Annotated[NonNegative, Unit("N s/m")] | None = Field(None, description="Damping of contacts.")
    frictionAnchor: Switch | None = Field(None, description="Whether friction drift is corrected.")
    localInertiaDiagonal: (
        Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False), Unit("kg m^2")] | None
    ) = Field(None, description="Principal moments of inertia of the base link.")
    ccdSweptSphereRadius: Annotated[NonNegative, Unit("m")] | None = Field(
        None, description="Radius of the sphere for continuous collision detection."
    )
    contactProcessingThreshold: Annotated[NonNegative, Unit("m")] | None = Field(
        None, description="Distance below which contacts are solved."
    )
    activationState: Annotated[int, ACTIVATION_STATES] | None = Field(None, description="ACTIVATION_STATE_... flags.")
    jointDamping: Annotated[NonNegative, Unit("N m s/rad or N s/m")] | None = Field(
        None, description="Damping of the joint."
    )
    anisotropicFriction: Vec3 | None = Field(None, description="Factors on friction along x, y and z.")
    maxJointVelocity: Annotated[Positive, Unit("rad/s or m/s")] | None = Field(
        None, description="Largest velocity of the joint."
    )
    collisionMargin: Annotated[NonNegative, Unit("m")] | None = Field(None, description="Margin around the shape.")
    jointLowerLimit: Annotated[float, Unit("rad or m")] | None = Field(None, description="Lower limit of the joint.")
    jointUpperLimit: Annotated[float, Unit("rad or m")] | None = Field(None, description="Upper limit of the joint.")
    jointLimitForce: Annotated[NonNegative, Unit("N m or N")] | None = Field(
        None, description="Largest effort at the joint's limits."
    )
    sleepThreshold: NonNegative | None = Field(None, description="Motion below which the body may sleep.")

    @model_validator(mode="after")
    def _stiffness_and_damping_together(self) -> ChangeDynamics:
        pair = {"contactStiffness": self.contactStiffness, "contactDamping": self.contactDamping}
        absent = [key for key, value in pair.items() if value is None]
        if len(absent) == 1:
            raise KeyedError(absent[0], f"missing, PyBullet wants {' and '.join(pair)} together")
        return self


class ResetBaseVelocity(PybulletModel):
    """How a body moves at the start."""

    linearVelocity: Annotated[Vec3, Unit("m/s")] | None = Field(None, description="Velocity in the world.")
    angularVelocity: Annotated[Vec3, Unit("rad/s")] | None = Field(None, description="Rotation in the world.")


class SetJointMotorControlArray(PybulletModel):
    """How the motors of a robot follow their targets."""

    controlMode: Annotated[int, CONTROL_MODES] = Field(description="What the targets are.")
    positionGains: Gains | None = Field(None, description="Position gain: one, one of each driven joint, or by joint.")
    velocityGains: Gains | None = Field(None, description="Velocity gain: one, one of each driven joint, or by joint.")


class ObjectTf(ConfigModel):
    """A TF frame to follow."""

    tf_id: FrameId = Field(description="Name of the frame.")
    hz: Hz = Field(30.0, description="How often to look.")


def _require(model: CreateVisualShape | CreateCollisionShape, shape: str, *sources: str) -> None:
    if model.shapeType == SHAPE_TYPES.parse(shape) and all(getattr(model, key) is None for key in sources):
        raise KeyedError(sources[0], f"missing, {shape} needs {' or '.join(sources)}")
