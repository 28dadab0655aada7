"""What YAML may hand to PyBullet's functions about soft bodies; each model is named after the function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    AlsoTakes,
    Count,
    KeyedError,
    Kilograms,
    Metres,
    NonNegative,
    NonNegativeMetres,
    Position,
    Positive,
    Quat,
    Rgb,
    Rgba,
    Switch,
    Text,
    Unit,
    optional,
)
from custom_ros_tools.schema.type_names import shown

from .asset_files import ExistingFile
from .pybullet_models import PybulletModel

Stiffness = Annotated[NonNegative, Unit("N/m")]
Pressure = Annotated[NonNegative, Unit("Pa")]


class LoadSoftBody(PybulletModel):
    """A soft body: its mesh, where it is put, and what it is made of."""

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
    """Another colour."""

    rgbaColor: Rgba | None = optional("Colour and opacity, each from 0 to 1.")
    specularColor: Rgb | None = optional("Colour of highlights, each from 0 to 1.")


class CreateSoftBodyAnchor(PybulletModel):
    """A corner that is tied to the world or to a link, at the distance that they have at the start.

    YAML has a list of the function's arguments: `[node, body, link, position]`, of which all but the first may be left
    out. `body` is a name, or -1 for the world; `link` a name, or an index where -1 is the base. An id of the soft body
    itself in front of them, as PyBullet has it, is accepted and means nothing.
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
    """Tells whether PyBullet's first argument, the id of the soft body itself, is in the list."""
    texts = [index for index, each in enumerate(arguments) if isinstance(each, str)]
    if texts:
        return texts[0] == 2
    return len(arguments) == 5 or (len(arguments) == 4 and isinstance(arguments[3], int))
