"""Configuration of `attach_marker`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from .errors import hint
from .schema import (
    ConfigModel,
    Expects,
    FrameId,
    Hz,
    KeyedError,
    ListOf,
    NonNegative,
    Position,
    Rgba,
    Switch,
    Text,
    TopicName,
)
from .transforms import quat_of

MARKER_TYPES = (
    "ARROW", "CUBE", "SPHERE", "CYLINDER", "LINE_STRIP", "LINE_LIST", "CUBE_LIST", "SPHERE_LIST", "POINTS",
    "TEXT_VIEW_FACING", "MESH_RESOURCE", "TRIANGLE_LIST",
)  # fmt: skip
"""Names of the constants of visualization_msgs/Marker for `type`."""
MARKER_ACTIONS = ("ADD", "MODIFY", "DELETE", "DELETEALL")
"""Names of its constants for `action`."""
SHAPES = ("ARROW", "CUBE", "SPHERE", "CYLINDER", "MESH_RESOURCE")
"""Marker types that this configuration can describe; the others need points or a text."""


def _in_any_case(names: Sequence[str]) -> WithJsonSchema:
    """Returns the JSON Schema of constants; editors propose the usual spelling."""
    usual = {"type": "string", "enum": [name.lower() for name in names]}
    return WithJsonSchema({"anyOf": [usual, {"type": "string", "pattern": "^[A-Za-z_]+$"}]})


def _one_of(names: Sequence[str], kind: str) -> AfterValidator:
    """Returns a validator that matches the name of a constant regardless of case."""

    def upper(name: str) -> str:
        if name.upper() not in names:
            raise ValueError(f"unknown marker {kind} '{name}'{hint(name, names)}")
        return name.upper()

    return AfterValidator(upper)


class MarkerNodeConfig(ConfigModel):
    """Topic and rate of the marker."""

    topic_name: TopicName = Field(description="Topic of the visualization_msgs/Marker.")
    hz: Hz = Field(50.0, description="Rate at which it is published, in wall time.")
    broadcast_offset: Switch = Field(False, description="Whether the marker's pose is published on TF, too.")
    child_frame_id: FrameId | None = Field(
        None, description="TF frame at the marker; required with `broadcast_offset`."
    )

    @model_validator(mode="after")
    def _names_the_frame_that_it_broadcasts(self) -> MarkerNodeConfig:
        if self.broadcast_offset and self.child_frame_id is None:
            raise KeyedError("child_frame_id", "missing, expected a TF frame since broadcast_offset is true")
        return self


class MarkerConfig(ConfigModel):
    """A marker at a fixed pose in a TF frame."""

    node: MarkerNodeConfig = Field(description="Topic and rate.")
    frame_id: FrameId = Field("map", description="TF frame that it is attached to.")
    type: Annotated[
        str, _one_of(MARKER_TYPES, "type"), _in_any_case(MARKER_TYPES), Expects("the name of a marker type")
    ] = Field(
        description="Constant of the message in any case: `cube`, `sphere`, `cylinder`, `arrow`, `mesh_resource`, ..."
    )
    action: Annotated[
        str, _one_of(MARKER_ACTIONS, "action"), _in_any_case(MARKER_ACTIONS), Expects("the name of a marker action")
    ] = Field("ADD", description="Constant of the message in any case: `add`, `modify`, `delete` or `deleteall`.")
    position: Position = Field((0.0, 0.0, 0.0), description="Position in that frame.")
    orientation: Annotated[ListOf[float], Expects("roll, pitch, yaw or a quaternion x, y, z, w")] = Field(
        (0.0, 0.0, 0.0),
        description="Roll, pitch, yaw or a quaternion x, y, z, w in that frame.",
    )
    ori_in_deg: Switch = Field(False, description="Whether roll, pitch and yaw are in degrees, else in radians.")
    rgba: Rgba = Field((0.0, 0.0, 1.0, 0.9), description="Colour and opacity, each from 0 to 1.")
    scale: Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False)] = Field(
        description="Size along x, y and z in m, or factors on a mesh."
    )
    mesh_resource: Text | None = Field(
        None,
        description="Mesh as `package://`, `{package}/`, `file://`, `http://` or absolute path; required for a mesh.",
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
        """Its orientation as a unit quaternion x, y, z, w."""
        return quat_of(self.orientation, self.ori_in_deg).tolist()

    @property
    def mesh_uri(self) -> str:
        """URI of the mesh for RViz; empty if there is none. `{package}/file` and plain paths become URIs."""
        path = self.mesh_resource or ""
        if path.startswith("{"):
            return "package://" + path[1:].replace("}", "", 1)
        return f"file://{path}" if path.startswith("/") else path
