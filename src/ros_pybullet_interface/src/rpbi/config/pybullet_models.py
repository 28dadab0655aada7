"""Models of the YAML keys that set arguments of PyBullet's functions for rigid and soft bodies.

Each model is named after a PyBullet function. A model's fields are the function's keyword arguments, except the ids of
bodies. A test checks that PyBullet accepts each field with values of the field's type.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import Discriminator, Field, Tag, model_validator

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
    NonNegativeMetres,
    OneAsList,
    Position,
    Positive,
    PositiveMetres,
    Quat,
    Rgb,
    Rgba,
    Seconds,
    Switch,
    Text,
    Unit,
    Vec3,
    optional,
)
from custom_ros_tools.schema.type_names import shown
from robot_model.asset_files import ExistingFile, RobotFile

from .pybullet_args import (
    ACTIVATION_STATES,
    COLLISION_SHAPE_FLAGS,
    CONTROL_MODES,
    SHAPE_TYPES,
    URDF_FLAGS,
    VISUAL_SHAPE_FLAGS,
)

HalfExtents = Annotated[tuple[PositiveMetres, PositiveMetres, PositiveMetres], Field(strict=False)]


Gains = Annotated[
    Annotated[ListOf[NonNegative], Tag("list")] | Annotated[dict[str, NonNegative], Tag("mapping")],
    Discriminator(lambda given: "mapping" if isinstance(given, Mapping) else "list"),
    OneAsList,
    AlsoTakes({"type": "number", "minimum": 0}),
    Expects("a number, a list of numbers or a mapping of joints to numbers"),
]
"""Gains of joints: one gain for all joints, a list with one gain per joint, or a mapping from joint names to gains."""
Stiffness = Annotated[NonNegative, Unit("N/m")]
Pressure = Annotated[NonNegative, Unit("Pa")]


class PybulletModel(ConfigModel):
    """Keyword arguments of one PyBullet function."""

    def kwargs(self) -> dict[str, Any]:
        """Returns the keyword arguments that YAML sets, with constants as numbers."""
        return self.model_dump(exclude_unset=True, exclude_none=True)


class LoadURDF(PybulletModel):
    """URDF file of a body, and the initial pose of the body."""

    fileName: RobotFile = Field(description="URDF file, or the word `robot_description` for the parameter.")
    basePosition: Position | None = optional("Position of the base in the world.")
    baseOrientation: Quat | None = optional("Orientation of the base in the world as x, y, z, w.")
    useFixedBase: Switch | None = optional("Whether the base is fixed to the world.")
    useMaximalCoordinates: Switch | None = optional("Whether joints are solved as constraints.")
    flags: Annotated[int, URDF_FLAGS] | None = optional("URDF_... flags.")
    globalScaling: Positive | None = optional("Factor on all lengths.")


class _CreateShape(PybulletModel):
    """Keys of both visual and collision shapes."""

    shapeType: Annotated[int, SHAPE_TYPES] = Field(description="GEOM_... constant.")
    radius: PositiveMetres | None = optional("Radius of a sphere, capsule or cylinder.")
    halfExtents: HalfExtents | None = optional("Half the edge lengths of a box.")
    fileName: ExistingFile | None = optional("Mesh file; of a shape to feel, also the file of a height field.")
    meshScale: Vec3 | None = optional("Factors on a mesh along x, y and z.")
    planeNormal: Direction | None = optional("Normal of a plane.")
    vertices: ListOf[Position] | None = optional("Corners of a mesh that has no file.")
    indices: ListOf[Count] | None = optional("Corner numbers of its triangles.")

    @model_validator(mode="after")
    def _mesh_has_a_source(self) -> Self:
        return self._require("GEOM_MESH", "fileName", "vertices")

    def _require(self, shape: str, *sources: str) -> Self:
        if self.shapeType == SHAPE_TYPES.parse(shape) and all(getattr(self, key) is None for key in sources):
            raise KeyedError(sources[0], f"missing, {shape} needs {' or '.join(sources)}")
        return self


class CreateVisualShape(_CreateShape):
    """Visual shape of an object."""

    length: PositiveMetres | None = optional("Length of a capsule or cylinder.")
    flags: Annotated[int, VISUAL_SHAPE_FLAGS] | None = optional("VISUAL_SHAPE_... flags.")
    rgbaColor: Rgba | None = optional("Colour and opacity, each from 0 to 1.")
    specularColor: Rgb | None = optional("Colour of highlights, each from 0 to 1.")
    visualFramePosition: Position | None = optional("Position of the shape in the body's frame.")
    visualFrameOrientation: Quat | None = optional("Orientation in the body's frame as x, y, z, w.")
    normals: ListOf[Vec3] | None = optional("Normals at the corners of a mesh.")
    uvs: ListOf[Annotated[tuple[float, float], Field(strict=False)]] | None = optional("Texture coordinates there.")

    @model_validator(mode="after")
    def _corners_have_all_or_nothing(self) -> Self:
        corners = len(self.vertices or ())
        for key in ("normals", "uvs"):
            given = getattr(self, key)
            if self.vertices is not None and given is not None and len(given) != corners:
                raise KeyedError(key, f"expected one for each of the {corners} vertices, got {len(given)}")
        return self


class CreateCollisionShape(_CreateShape):
    """Collision shape of an object."""

    height: PositiveMetres | None = optional("Length of a capsule or cylinder.")
    flags: Annotated[int, COLLISION_SHAPE_FLAGS] | None = optional("GEOM_... flags.")
    collisionFramePosition: Position | None = optional("Position of the shape in the body's frame.")
    collisionFrameOrientation: Quat | None = optional("Orientation in the body's frame as x, y, z, w.")
    heightfieldTextureScaling: Positive | None = optional("Repetitions of a height field's texture.")
    heightfieldData: ListOf[Metres] | None = optional("Heights, row by row.")
    numHeightfieldRows: Count | None = optional("Rows of the height field.")
    numHeightfieldColumns: Count | None = optional("Columns of the height field.")

    @model_validator(mode="after")
    def _height_field_has_a_source(self) -> Self:
        self._require("GEOM_HEIGHTFIELD", "fileName", "heightfieldData")
        if self.heightfieldData is not None and self.shapeType == SHAPE_TYPES.parse("GEOM_HEIGHTFIELD"):
            rows, columns, count = (
                self.numHeightfieldRows or 0,
                self.numHeightfieldColumns or 0,
                len(self.heightfieldData),
            )
            if rows < 2 or columns < 2 or rows * columns != count:
                expected = "expected one height for each of at least 2 numHeightfieldRows and 2 numHeightfieldColumns"
                raise KeyedError("heightfieldData", f"{expected}, got {count} for {rows} by {columns}")
        return self


class ChangeDynamics(PybulletModel):
    """Dynamics of a body, such as mass, friction and damping."""

    mass: Kilograms | None = optional("Mass of the base link.")
    lateralFriction: NonNegative | None = optional("Coulomb friction coefficient.")
    spinningFriction: NonNegative | None = optional("Friction about the contact normal.")
    rollingFriction: NonNegative | None = optional("Friction against rolling.")
    restitution: NonNegative | None = optional("Bounciness; 0 does not bounce, 1 keeps all energy.")
    linearDamping: NonNegative | None = optional("Share of linear velocity lost.")
    angularDamping: NonNegative | None = optional("Share of angular velocity lost.")
    contactStiffness: Annotated[NonNegative, Unit("N/m")] | None = optional("Stiffness of contacts.")
    contactDamping: Annotated[NonNegative, Unit("N s/m")] | None = optional("Damping of contacts.")
    frictionAnchor: Switch | None = optional("Whether friction drift is corrected.")
    localInertiaDiagonal: (
        Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False), Unit("kg m^2")] | None
    ) = optional("Principal moments of inertia of the base link.")
    ccdSweptSphereRadius: NonNegativeMetres | None = optional(
        "Radius of the sphere for continuous collision detection."
    )
    contactProcessingThreshold: NonNegativeMetres | None = optional("Distance below which contacts are solved.")
    activationState: Annotated[int, ACTIVATION_STATES] | None = optional("ACTIVATION_STATE_... flags.")
    jointDamping: Annotated[NonNegative, Unit("N m s/rad or N s/m")] | None = optional("Damping of the joint.")
    anisotropicFriction: Vec3 | None = optional("Factors on friction along x, y and z.")
    maxJointVelocity: Annotated[Positive, Unit("rad/s or m/s")] | None = optional("Largest velocity of the joint.")
    collisionMargin: NonNegativeMetres | None = optional("Margin around the shape.")
    jointLowerLimit: Annotated[float, Unit("rad or m")] | None = optional("Lower limit of the joint.")
    jointUpperLimit: Annotated[float, Unit("rad or m")] | None = optional("Upper limit of the joint.")
    jointLimitForce: Annotated[NonNegative, Unit("N m or N")] | None = optional("Largest effort at the joint's limits.")
    sleepThreshold: NonNegative | None = optional("Motion below which the body may sleep.")

    @model_validator(mode="after")
    def _stiffness_and_damping_together(self) -> ChangeDynamics:
        pair = {"contactStiffness": self.contactStiffness, "contactDamping": self.contactDamping}
        absent = [key for key, value in pair.items() if value is None]
        if len(absent) == 1:
            raise KeyedError(absent[0], f"missing, PyBullet wants {' and '.join(pair)} together")
        return self


class ResetBaseVelocity(PybulletModel):
    """Initial velocity of a body."""

    linearVelocity: Annotated[Vec3, Unit("m/s")] | None = optional("Velocity in the world.")
    angularVelocity: Annotated[Vec3, Unit("rad/s")] | None = optional("Rotation in the world.")


class SetJointMotorControlArray(PybulletModel):
    """Control mode and gains of a robot's motors."""

    controlMode: Annotated[int, CONTROL_MODES] = Field(description="Quantity of the targets.")
    positionGains: Gains | None = optional("Position gain: one, one of each driven joint, or by joint.")
    velocityGains: Gains | None = optional("Velocity gain: one, one of each driven joint, or by joint.")


class ObjectTf(ConfigModel):
    """The TF frame that an object or camera follows."""

    tf_id: FrameId = Field(description="Name of the frame.")
    hz: Hz = Field(30.0, description="Rate of look-ups.")
    timeout_s: Seconds = Field(0.5, description="Without anything new for so long, it is reported as stale.")

    max_speed: Annotated[Positive, Field(le=100.0), Unit("m/s")] = Field(
        5.0, description="Largest speed of what can be touched."
    )
    max_angular_speed: Annotated[Positive, Field(le=100.0), Unit("rad/s")] = Field(
        10.0, description="Fastest rotation of what can be touched."
    )


class LoadSoftBody(PybulletModel):
    """A soft body: mesh, placement and material."""

    fileName: ExistingFile = Field(description="Mesh: tetrahedra (.vtk) or a surface (.obj).")
    simFileName: ExistingFile | None = optional("Mesh to simulate (.vtk) where `fileName` is only what it looks like.")
    basePosition: Position | None = optional("Start position.")
    baseOrientation: Quat | None = optional("Start orientation as x, y, z, w.")
    scale: Positive | None = optional("Factor on all lengths of the mesh.")
    mass: Annotated[Kilograms, Field(gt=0)] | None = optional("Mass of the whole body.")
    collisionMargin: NonNegativeMetres | None = optional("Margin around the surface.")
    useMassSpring: Switch | None = optional("Whether it is made of springs, as cloth is.")
    useBendingSprings: Switch | None = optional("Whether springs resist bending as well.")
    useNeoHookean: Switch | None = optional("Whether it is a neo-Hookean solid; needs tetrahedra.")
    springElasticStiffness: Stiffness | None = optional("Stiffness of the springs.")
    springDampingStiffness: Annotated[NonNegative, Unit("N s/m")] | None = optional("Damping of the springs.")
    springDampingAllDirections: Switch | None = optional(
        "Whether damping acts in all directions, else along the springs."
    )
    springBendingStiffness: Stiffness | None = optional("Stiffness against bending.")
    NeoHookeanMu: Pressure | None = optional("First Lame parameter, against shear.")
    NeoHookeanLambda: Pressure | None = optional("Second Lame parameter, against compression.")
    NeoHookeanDamping: NonNegative | None = optional("Damping of the solid.")
    frictionCoeff: NonNegative | None = optional("Coulomb friction coefficient.")
    useFaceContact: Switch | None = optional("Whether faces touch too, not only corners.")
    useSelfCollision: Switch | None = optional("Whether it touches itself.")
    repulsionStiffness: Stiffness | None = optional("Stiffness of the push out of contact.")


class ChangeVisualShape(PybulletModel):
    """Colours that replace the colours in the object's file."""

    rgbaColor: Rgba | None = optional("Colour and opacity, each from 0 to 1.")
    specularColor: Rgb | None = optional("Colour of highlights, each from 0 to 1.")


class CreateSoftBodyAnchor(PybulletModel):
    """A corner of a soft body that keeps its initial position relative to the world or to a link.

    In YAML, this is a list of the function's arguments, `[node, body, link, position]`. All arguments but `node` are
    optional. `body` is a name, or -1 for the world. `link` is a name or an index, where -1 is the base. The soft body's
    own id may come first, as in PyBullet, and is ignored.
    """

    node: Count = Field(description="Number of the corner in the simulated mesh.")
    body: Text | None = optional("Name of the body that it is tied to, none for the world.")
    link: Text | Annotated[int, Field(ge=-1)] = Field(-1, description="Name or index of its link.")
    position: tuple[Metres, Metres, Metres] = Field(
        (0.0, 0.0, 0.0), strict=False, description="Accepted without effect, as in PyBullet."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_list(cls, given: Any) -> Any:
        if isinstance(given, (Mapping, cls)):
            return given
        if not isinstance(given, Sequence) or isinstance(given, str) or not 1 <= len(given) <= 5:
            raise ValueError(f"expected a list [node, body, link, position], got {shown(given)}")
        arguments = list(given)
        if _has_own_id(arguments):
            del arguments[0]
        named = dict(zip(("node", "body", "link", "position"), arguments))
        body = named.get("body")
        if body == -1:
            named["body"] = None
        elif body is not None and not isinstance(body, str):
            raise KeyedError("body", f"expected the name of a body, or -1 for the world; got {shown(body)}")
        return named


_ARGUMENT = {"type": ["string", "integer", "null", "array"], "items": {"type": "number"}}
AnchorEntry = Annotated[
    CreateSoftBodyAnchor, AlsoTakes({"type": "array", "minItems": 1, "maxItems": 5, "items": _ARGUMENT})
]


def _has_own_id(arguments: list[Any]) -> bool:
    """Returns whether a list of arguments begins with the soft body's own id, as in PyBullet."""
    texts = [index for index, each in enumerate(arguments) if isinstance(each, str)]
    if texts:
        return texts[0] == 2
    return len(arguments) == 5 or (len(arguments) == 4 and isinstance(arguments[3], int))
