"""Models of the YAML keys that set arguments of PyBullet's functions for rigid and soft bodies.

Each model is named after a PyBullet function. A model's fields are the function's keyword arguments, except the ids of
bodies. A test checks that PyBullet accepts each field with values of the field's type.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, model_validator
from typing_extensions import Self

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

    fileName: RobotFile = Field(
        description="URDF file, or the word `robot_description` for the URDF in the parameter of this name."
    )
    basePosition: Position | None = optional("Position of the base in the world. By default, the origin.")
    baseOrientation: Quat | None = optional(
        "Orientation of the base in the world, x, y, z, w. By default, the base has the world's orientation."
    )
    useFixedBase: Switch | None = optional("Whether the base is fixed to the world. By default, it is not.")
    useMaximalCoordinates: Switch | None = optional(
        "Whether each link is a separate rigid body, with joints as constraints."
    )
    flags: Annotated[int, URDF_FLAGS] | None = optional("One or more URDF_... constants.")
    globalScaling: Positive | None = optional("Scale factor of the whole body.")


class _CreateShape(PybulletModel):
    """Keys of both visual and collision shapes."""

    shapeType: Annotated[int, SHAPE_TYPES] = Field(description="Type of the shape, a GEOM_... constant.")
    radius: PositiveMetres | None = optional("Radius of a sphere, capsule or cylinder.")
    halfExtents: HalfExtents | None = optional("Half the edge lengths of a box.")
    fileName: ExistingFile | None = optional("Mesh file; in a collision shape, also the file of a height field.")
    meshScale: Vec3 | None = optional("Scale factors of a mesh along x, y and z.")
    planeNormal: Direction | None = optional("Normal of a plane.")
    vertices: ListOf[Position] | None = optional("Vertices of a mesh without a file.")
    indices: ListOf[Count] | None = optional("Vertex indices of the mesh's triangles.")

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
    flags: Annotated[int, VISUAL_SHAPE_FLAGS] | None = optional("One or more VISUAL_SHAPE_... constants.")
    rgbaColor: Rgba | None = optional("Colour and opacity: red, green, blue and alpha, each from 0 to 1.")
    specularColor: Rgb | None = optional("Colour of highlights: red, green and blue, each from 0 to 1.")
    visualFramePosition: Position | None = optional("Position of the shape in the body's frame.")
    visualFrameOrientation: Quat | None = optional("Orientation of the shape in the body's frame, x, y, z, w.")
    normals: ListOf[Vec3] | None = optional("Normals at the vertices of a mesh.")
    uvs: ListOf[Annotated[tuple[float, float], Field(strict=False)]] | None = optional(
        "Texture coordinates of the vertices of a mesh."
    )

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
    flags: Annotated[int, COLLISION_SHAPE_FLAGS] | None = optional("One or more GEOM_... flags.")
    collisionFramePosition: Position | None = optional("Position of the shape in the body's frame.")
    collisionFrameOrientation: Quat | None = optional("Orientation of the shape in the body's frame, x, y, z, w.")
    heightfieldTextureScaling: Positive | None = optional("Number of repetitions of a height field's texture.")
    heightfieldData: ListOf[Metres] | None = optional("Heights of a height field, row by row.")
    numHeightfieldRows: Count | None = optional("Number of rows of a height field.")
    numHeightfieldColumns: Count | None = optional("Number of columns of a height field.")

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
    spinningFriction: NonNegative | None = optional(
        "Coefficient of friction against rotation about the contact normal."
    )
    rollingFriction: NonNegative | None = optional("Coefficient of friction against rolling.")
    restitution: NonNegative | None = optional(
        "Coefficient of restitution: with 0 the body does not bounce, with 1 a bounce loses no energy."
    )
    linearDamping: NonNegative | None = optional("Fraction of the linear velocity that is lost per second.")
    angularDamping: NonNegative | None = optional("Fraction of the angular velocity that is lost per second.")
    contactStiffness: Annotated[NonNegative, Unit("N/m")] | None = optional(
        "Stiffness of contacts; requires `contactDamping`."
    )
    contactDamping: Annotated[NonNegative, Unit("N s/m")] | None = optional(
        "Damping of contacts; requires `contactStiffness`."
    )
    frictionAnchor: Switch | None = optional("Whether drift at contacts with friction is corrected.")
    localInertiaDiagonal: (
        Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False), Unit("kg m^2")] | None
    ) = optional("Principal moments of inertia of the base link.")
    ccdSweptSphereRadius: NonNegativeMetres | None = optional(
        "Radius of the sphere that continuous collision detection uses."
    )
    contactProcessingThreshold: NonNegativeMetres | None = optional(
        "Distance between two bodies below which the solver takes their contact into account."
    )
    activationState: Annotated[int, ACTIVATION_STATES] | None = optional("One or more ACTIVATION_STATE_... constants.")
    jointDamping: Annotated[NonNegative, Unit("N m s/rad or N s/m")] | None = optional("Damping of the joint.")
    anisotropicFriction: Vec3 | None = optional("Factors of the friction along x, y and z.")
    maxJointVelocity: Annotated[Positive, Unit("rad/s or m/s")] | None = optional("Largest velocity of the joint.")
    collisionMargin: NonNegativeMetres | None = optional("Margin around the collision shape.")
    jointLowerLimit: Annotated[float, Unit("rad or m")] | None = optional("Lower limit of the joint.")
    jointUpperLimit: Annotated[float, Unit("rad or m")] | None = optional("Upper limit of the joint.")
    jointLimitForce: Annotated[NonNegative, Unit("N m or N")] | None = optional(
        "Largest effort at the limits of the joint."
    )
    sleepThreshold: NonNegative | None = optional("Motion below which the body may be deactivated.")

    @model_validator(mode="after")
    def _stiffness_and_damping_together(self) -> ChangeDynamics:
        pair = {"contactStiffness": self.contactStiffness, "contactDamping": self.contactDamping}
        absent = [key for key, value in pair.items() if value is None]
        if len(absent) == 1:
            raise KeyedError(absent[0], f"missing, PyBullet wants {' and '.join(pair)} together")
        return self


class ResetBaseVelocity(PybulletModel):
    """Initial velocity of a body."""

    linearVelocity: Annotated[Vec3, Unit("m/s")] | None = optional("Linear velocity in the world frame.")
    angularVelocity: Annotated[Vec3, Unit("rad/s")] | None = optional("Angular velocity in the world frame.")


class SetJointMotorControlArray(PybulletModel):
    """Control mode and gains of a robot's motors."""

    controlMode: Annotated[int, CONTROL_MODES] = Field(
        description="Control mode of the motors, which determines the quantity of the targets."
    )
    positionGains: Gains | None = optional(
        "Position gains: one for all joints, a list with one for each driven joint, or a mapping from joint names to "
        "gains."
    )
    velocityGains: Gains | None = optional(
        "Velocity gains: one for all joints, a list with one for each driven joint, or a mapping from joint names to "
        "gains."
    )


class ObjectTf(ConfigModel):
    """The TF frame that an object or camera follows."""

    tf_id: FrameId = Field(description="Name of the TF frame.")
    hz: Hz = Field(30.0, description="Rate at which the frame is looked up.")
    timeout_s: Seconds = Field(
        0.5, description="Time without a new pose after which a warning reports the frame as stale."
    )

    max_speed: Annotated[Positive, Field(le=100.0), Unit("m/s")] = Field(
        5.0, description="Largest speed with which a body with contacts follows the frame."
    )
    max_angular_speed: Annotated[Positive, Field(le=100.0), Unit("rad/s")] = Field(
        10.0, description="Largest angular speed with which a body with contacts follows the frame."
    )


class LoadSoftBody(PybulletModel):
    """A soft body: mesh, placement and material."""

    fileName: ExistingFile = Field(description="Mesh file: tetrahedra (.vtk) or a surface (.obj).")
    simFileName: ExistingFile | None = optional(
        "Mesh file (.vtk) that is simulated, while `fileName` is only displayed. By default, `fileName` is simulated."
    )
    basePosition: Position | None = optional("Start position in the world.")
    baseOrientation: Quat | None = optional("Start orientation in the world, x, y, z, w.")
    scale: Positive | None = optional("Scale factor of the mesh.")
    mass: Annotated[Kilograms, Field(gt=0)] | None = optional("Mass of the whole body.")
    collisionMargin: NonNegativeMetres | None = optional("Margin around the surface.")
    useMassSpring: Switch | None = optional("Whether springs connect the vertices, as in cloth.")
    useBendingSprings: Switch | None = optional("Whether additional springs resist bending.")
    useNeoHookean: Switch | None = optional("Whether the body is a neo-Hookean solid; requires tetrahedra.")
    springElasticStiffness: Stiffness | None = optional("Stiffness of the springs.")
    springDampingStiffness: Annotated[NonNegative, Unit("N s/m")] | None = optional("Damping of the springs.")
    springDampingAllDirections: Switch | None = optional(
        "Whether springs damp motion in all directions, otherwise only along the springs."
    )
    springBendingStiffness: Stiffness | None = optional("Stiffness of the springs that resist bending.")
    NeoHookeanMu: Pressure | None = optional("First Lame parameter of a neo-Hookean solid, its resistance to shear.")
    NeoHookeanLambda: Pressure | None = optional(
        "Second Lame parameter of a neo-Hookean solid, its resistance to compression."
    )
    NeoHookeanDamping: NonNegative | None = optional("Damping of a neo-Hookean solid.")
    frictionCoeff: NonNegative | None = optional("Coulomb friction coefficient.")
    useFaceContact: Switch | None = optional("Whether faces collide, in addition to vertices.")
    useSelfCollision: Switch | None = optional("Whether parts of the body collide with each other.")
    repulsionStiffness: Stiffness | None = optional("Stiffness of the repulsion at contacts.")


class ChangeVisualShape(PybulletModel):
    """Colours that replace the colours in the object's file."""

    rgbaColor: Rgba | None = optional("Colour and opacity: red, green, blue and alpha, each from 0 to 1.")
    specularColor: Rgb | None = optional("Colour of highlights: red, green and blue, each from 0 to 1.")


class CreateSoftBodyAnchor(PybulletModel):
    """A corner of a soft body that keeps its initial position relative to the world or to a link.

    In YAML, this is a list of the function's arguments, `[node, body, link, position]`. All arguments but `node` are
    optional. `body` is a name, or -1 for the world. `link` is a name or an index, where -1 is the base. The soft body's
    own id may come first, as in PyBullet, and is ignored.
    """

    node: Count = Field(description="Index of the vertex in the simulated mesh.")
    body: Text | None = optional("Body to which the vertex is tied. By default, the vertex is fixed in the world.")
    link: Text | Annotated[int, Field(ge=-1)] = Field(
        -1, description="Name or index of the body's link to which the vertex is tied; -1 is the base."
    )
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
