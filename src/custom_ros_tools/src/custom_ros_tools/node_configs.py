"""Pydantic models of `~config` and of the other private parameters of this package's nodes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from .errors import hint
from .joint_values import JointConversion
from .schema import (
    ConfigModel,
    Expects,
    FrameId,
    Hz,
    KeyedError,
    ListOf,
    NonNegative,
    Position,
    Positive,
    Rgba,
    Switch,
    Text,
    TopicName,
    Unit,
    optional,
)
from .transforms import quat_of

MARKER_TYPES = (
    "ARROW", "CUBE", "SPHERE", "CYLINDER", "LINE_STRIP", "LINE_LIST", "CUBE_LIST", "SPHERE_LIST", "POINTS",
    "TEXT_VIEW_FACING", "MESH_RESOURCE", "TRIANGLE_LIST",
)  # fmt: skip
"""Names of the constants for the field `type` of visualization_msgs/Marker."""
MARKER_ACTIONS = ("ADD", "MODIFY", "DELETE", "DELETEALL")
"""Names of the constants for the field `action` of visualization_msgs/Marker."""
SHAPES = ("ARROW", "CUBE", "SPHERE", "CYLINDER", "MESH_RESOURCE")
"""Marker types that `MarkerConfig` can describe completely. Other types need points or a text."""
PER_SI_UNIT = {"rad": 1.0, "deg": 180.0 / math.pi, "m": 1.0, "mm": 1000.0}
"""Number of each unit in 1 rad or 1 m."""


def _in_any_case(names: Sequence[str]) -> WithJsonSchema:
    """Makes the JSON Schema of constants in upper or lower case; editors propose the lower-case spelling."""
    usual = {"type": "string", "enum": [name.lower() for name in names]}
    return WithJsonSchema({"anyOf": [usual, {"type": "string", "pattern": "^[A-Za-z_]+$"}]})


def _one_of(names: Sequence[str], kind: str) -> AfterValidator:
    """Makes a validator that accepts names of constants in upper or lower case, and converts them to upper case.

    Args:
        names: The constants in upper case.
        kind: Noun for the constants in error messages.
    """

    def upper(name: str) -> str:
        if name.upper() not in names:
            raise ValueError(f"unknown marker {kind} '{name}'{hint(name, names)}")
        return name.upper()

    return AfterValidator(upper)


class MarkerNodeConfig(ConfigModel):
    """Topic and rate of a published marker, and whether its pose is broadcast on TF."""

    topic_name: TopicName = Field(description="Topic of the marker, a visualization_msgs/Marker.")
    hz: Hz = Field(50.0, description="Rate of the marker, in wall time.")
    broadcast_offset: Switch = Field(False, description="Whether the marker's pose is also published on TF.")
    child_frame_id: FrameId | None = Field(
        None, description="TF frame at the marker's pose; required with `broadcast_offset`."
    )

    @model_validator(mode="after")
    def _names_the_frame_that_it_broadcasts(self) -> MarkerNodeConfig:
        if self.broadcast_offset and self.child_frame_id is None:
            raise KeyedError("child_frame_id", "missing, expected a TF frame since broadcast_offset is true")
        return self


class MarkerConfig(ConfigModel):
    """A marker at a fixed pose in a TF frame."""

    node: MarkerNodeConfig = Field(description="Topic and rate of the marker.")
    frame_id: FrameId = Field("map", description="TF frame to which the marker is attached.")
    type: Annotated[
        str, _one_of(MARKER_TYPES, "type"), _in_any_case(MARKER_TYPES), Expects("the name of a marker type")
    ] = Field(
        description="Type of the marker, a constant of visualization_msgs/Marker in upper or lower case: `cube`, "
        "`sphere`, `cylinder`, `arrow`, `mesh_resource`, ..."
    )
    action: Annotated[
        str, _one_of(MARKER_ACTIONS, "action"), _in_any_case(MARKER_ACTIONS), Expects("the name of a marker action")
    ] = Field(
        "ADD",
        description="Action of the marker, a constant of visualization_msgs/Marker in upper or lower case: `add`, "
        "`modify`, `delete` or `deleteall`.",
    )
    position: Position = Field((0.0, 0.0, 0.0), description="Position of the marker in `frame_id`.")
    orientation: Annotated[ListOf[float], Expects("roll, pitch, yaw or a quaternion x, y, z, w")] = Field(
        (0.0, 0.0, 0.0),
        description="Orientation of the marker in `frame_id`: roll, pitch, yaw, or a quaternion x, y, z, w.",
    )
    ori_in_deg: Switch = Field(False, description="Whether roll, pitch and yaw are in degrees, otherwise in radians.")
    rgba: Rgba = Field(
        (0.0, 0.0, 1.0, 0.9), description="Colour and opacity: red, green, blue and alpha, each from 0 to 1."
    )
    scale: Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False)] = Field(
        description="Size along x, y and z [m], or scale factors of a mesh."
    )
    mesh_resource: Text | None = Field(
        None,
        description="Mesh file: `package://`, `{package}/`, `file://`, `http://` or an absolute path; required for "
        "the type `mesh_resource`.",
    )

    @model_validator(mode="after")
    def _can_be_drawn(self) -> MarkerConfig:
        try:
            quat_of(self.orientation, self.ori_in_deg)
        except ValueError as error:
            raise KeyedError("orientation", str(error).removeprefix("orientation: ")) from None
        if self.type == "MESH_RESOURCE" and self.mesh_resource is None:
            raise KeyedError("mesh_resource", "missing, expected a file since type is MESH_RESOURCE")
        return self

    @property
    def quat_xyzw(self) -> list[float]:
        """The marker's orientation as a unit quaternion x, y, z, w."""
        return quat_of(self.orientation, self.ori_in_deg).tolist()

    @property
    def mesh_uri(self) -> str:
        """URI of the mesh for RViz, made from `mesh_resource`; empty for a marker without mesh."""
        path = self.mesh_resource or ""
        if path.startswith("{"):
            return "package://" + path[1:].replace("}", "", 1)
        return f"file://{path}" if path.startswith("/") else path


class StartParameters(ConfigModel):
    """Parameters of a node that can be switched on and off."""

    start_on_init: Switch = Field(False, description="Whether the node is switched on at the start.")


class RateParameters(ConfigModel):
    """Parameters of a node that publishes a message at a fixed rate."""

    hz: Hz = Field(100.0, description="Rate of the published message, in wall time.")


class RemappedJoint(ConfigModel):
    """Conversion of a joint from the simulator to a driver, see `JointConversion`; `unit` determines the factor."""

    joint: Text = Field(description="Name of the joint in the simulator.")
    rename: Text | None = Field(
        None, description="Name of the joint at the driver. By default, the name in the simulator."
    )
    unit: Literal["rad", "deg", "m", "mm"] = Field(
        "rad",
        description="Unit of positions at the driver; velocities are in the same unit per second. `rad` and `m` "
        "leave numbers unchanged.",
    )
    sign: Literal[1, -1] = Field(
        1, description="-1 if the joint has the opposite direction at the driver, also for efforts."
    )
    offset: float = Field(
        0.0, description="Position at the driver, in `unit`, when the position in the simulator is 0."
    )

    def conversion(self) -> JointConversion:
        """Makes the conversion from the simulator to the driver."""
        return JointConversion(self.joint, self.rename or self.joint, self.sign, PER_SI_UNIT[self.unit], self.offset)


class StartWithin(ConfigModel):
    """Condition for switching a node on: the robot must be near the first command, to avoid a jump."""

    topic: Text = Field(
        description="Topic of the commanded robot's joint states, with the names and units of the commands."
    )
    tolerance: Annotated[Positive, Unit("rad or m")] = Field(
        0.05, description="Largest initial difference between a joint and its command at which the node starts."
    )


class RemapConfig(ConfigModel):
    """Selection and order of forwarded joints, and the joints' names and units at the receiver."""

    joint_names: ListOf[Text] | None = Field(
        None,
        description="Names of the forwarded joints in received messages, in the order in which they are published. "
        "By default, all joints in the order received.",
    )
    joints: ListOf[RemappedJoint] = Field((), description="Joints whose name or unit differs at the driver.")
    inverse: Switch = Field(
        False, description="Whether `joints` is applied inversely: from the driver to the simulator."
    )
    start_within: StartWithin | None = optional(
        "Condition for switching the node on. By default, there is no condition."
    )

    @model_validator(mode="after")
    def _joints_differ_in_name(self) -> RemapConfig:
        _require_unique("joint", (each.joint for each in self.joints))
        _require_unique("rename", (each.conversion().name for each in self.joints))
        return self

    def conversions(self) -> tuple[JointConversion, ...]:
        """Makes the conversions of all forwarded joints in `joints`, inverted if `inverse` is true."""
        there = (each.conversion() for each in self.joints)
        conversions = (each.inverse() if self.inverse else each for each in there)
        wanted = self.joint_names
        return tuple(each for each in conversions if wanted is None or each.joint in wanted)


def _require_unique(key: str, names: Iterable[str]) -> None:
    seen: set[str] = set()
    for index, name in enumerate(names):
        if name in seen:
            raise KeyedError(f"joints[{index}].{key}", f"'{name}' is the name of another joint of this list")
        seen.add(name)


class FloatArrayConfig(RemapConfig):
    """Quantity, selection and order of the joint values that are published as an array."""

    field: Literal["position", "velocity", "effort"] = Field("position", description="Quantity that is published.")


NODE_CONFIGS: dict[str, type[ConfigModel]] = {
    "attach_marker": MarkerConfig,
    "remap_joint_state_to_floatarray": FloatArrayConfig,
    "remap_joint_state_to_joint_state": RemapConfig,
}
