"""Parameters of the primitives node, and the JSON Schema of the YAML files with these parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    FrameId,
    Hz,
    KeyedError,
    ListOf,
    Positive,
    PositiveMetres,
    Switch,
    Text,
    TopicName,
    Unit,
    optional,
)
from custom_ros_tools.schema.json_schema import explained, json_schema, schema_text

from .coupling import ForceCoupling, ObstacleCoupling
from .space import POSE, Space

Bounds = Annotated[tuple[float, float], Field(strict=False)]


class FrameSource(ConfigModel):
    """A TF frame whose pose over time is used as a demonstration."""

    parent: FrameId = Field(description="TF frame in which poses are given.")
    child: FrameId = Field(description="TF frame whose motion is recorded.")
    orientation: Switch = Field(True, description="Whether orientations are part of the motion.")


class JointSource(ConfigModel):
    """Joints whose positions over time are used as a demonstration."""

    topic: TopicName = Field("joint_states", description="Topic of the joint states, both live and in bags.")
    names: ListOf[Text] = Field(
        min_length=1, description="Names of the joints, in the order of the positions in a point."
    )


class SourceConfig(ConfigModel):
    """Source of demonstrations: either a TF frame or joints."""

    tf: FrameSource | None = optional("TF frame as the source. Either this key or `joints` is required.")
    joints: JointSource | None = optional("Joints of a robot as the source. Either this key or `tf` is required.")

    @model_validator(mode="after")
    def _is_one(self) -> SourceConfig:
        if (self.tf is None) == (self.joints is None):
            raise KeyedError("tf", "a source is either tf or joints, one of them")
        return self

    @property
    def space(self) -> Space:
        """Space of the points that the source provides."""
        if self.joints is not None:
            return Space(tuple(self.joints.names))
        return Space(POSE, self.tf is not None and self.tf.orientation)


class FrameOutput(ConfigModel):
    """TF frame that is broadcast."""

    parent: FrameId = Field(description="TF frame in which poses are given.")
    child: FrameId = Field(description="TF frame that is broadcast.")


class JointOutput(ConfigModel):
    """Topic on which joint targets are published."""

    topic: TopicName = Field("joint_states/target", description="Topic of the joint targets.")


class SignalOutput(ConfigModel):
    """Topic on which the point or the velocity is published as an array of numbers."""

    topic: TopicName = Field("primitive/signal", description="Topic of the array of numbers.")
    content: Literal["position", "velocity"] = Field(
        "position",
        description="Content of the array: the point or its velocity. The velocity is 0 after the end of the motion.",
    )


class OutputConfig(ConfigModel):
    """Topics and TF frame to which executed motions are published; several can be used at the same time."""

    tf: FrameOutput | None = optional(
        "TF frame that is broadcast; requires a TF frame as the source. By default, no frame is broadcast."
    )
    joints: JointOutput | None = optional(
        "Joint targets that are published; requires joints as the source. By default, no joint targets are published."
    )
    signal: SignalOutput | None = optional("Array of numbers that is published. By default, no array is published.")


class ObstacleConfig(ConfigModel):
    """A ball that motions avoid."""

    frame_id: FrameId = Field(description="TF frame at the centre of the ball.")
    radius: PositiveMetres = Field(0.05, description="Radius of the ball.")
    range: PositiveMetres = Field(
        0.1, description="Distance from the ball's surface at which the avoidance has fallen to 37 %."
    )
    gain: Positive = Field(1000.0, description="Strength of the avoidance.")

    def obstacle(self) -> ObstacleCoupling:
        """Makes the obstacle coupling, with the ball's centre at the origin."""
        return ObstacleCoupling((0.0, 0.0, 0.0), self.radius, self.range, self.gain)


class CouplingConfig(ConfigModel):
    """Couplings with which an executed motion yields to forces and avoids obstacles."""

    force_stiffness: Annotated[Positive, Unit("N/m")] | None = optional(
        "Stiffness with which positions yield to the forces on `primitive/wrench`, which are given in the axes of "
        "the source's parent frame. By default, positions do not yield."
    )
    torque_stiffness: Annotated[Positive, Unit("N m/rad")] | None = optional(
        "Stiffness with which orientations yield to the torques on `primitive/wrench`; requires `force_stiffness`. "
        "By default, orientations do not yield."
    )
    obstacles: ListOf[ObstacleConfig] = Field((), description="Balls that the motion avoids.")

    def force(self, space: Space) -> ForceCoupling | None:
        """Makes the coupling to forces; returns None if `force_stiffness` is not configured."""
        if self.force_stiffness is None:
            return None
        stiffness = [self.force_stiffness] * len(space.names)
        rotational = float("inf") if self.torque_stiffness is None else self.torque_stiffness
        return ForceCoupling(stiffness + [rotational] * (space.dof - len(space.names)))


class PrimitivesNodeConfig(ConfigModel):
    """Configuration of the node that learns, plans and executes motions."""

    primitive: dict[Text, Any] = Field(
        {"type": "dmp"}, description="Type of the primitive, a name or `module:Class`, and the options of this type."
    )
    source: SourceConfig = Field(description="Source of demonstrations.")
    output: OutputConfig = Field(OutputConfig(), description="Outputs of an executed motion.")
    coupling: CouplingConfig = Field(
        CouplingConfig(), description="Reactions of an executed motion to forces and obstacles."
    )
    bounds: dict[Text, Bounds] = Field(
        {},
        description="Least and largest position [m or rad], keyed by position name. A plan beyond these bounds is "
        "refused.",
    )
    hz: Hz = Field(100.0, description="Rate at which TF is recorded and motions are executed, in wall time.")
    folder: Text = Field("~/.ros/primitives", description="Folder in which primitives are saved.")

    @model_validator(mode="after")
    def _fits_together(self) -> PrimitivesNodeConfig:
        if not isinstance(self.primitive.get("type"), str):
            raise KeyedError("primitive.type", "expected the name of a primitive")
        if self.output.tf is not None and self.source.tf is None:
            raise KeyedError("output.tf", "the source are joints; use joints or signal")
        if self.output.joints is not None and self.source.joints is None:
            raise KeyedError("output.joints", "the source is a TF frame; use tf or signal")
        if self.coupling.torque_stiffness is not None and self.coupling.force_stiffness is None:
            raise KeyedError("coupling.force_stiffness", "missing; torque_stiffness goes with it")
        has_coupling = self.coupling.force_stiffness is not None or self.coupling.obstacles
        if has_coupling and self.source.tf is None:
            raise KeyedError("coupling", "forces and obstacles are for a source tf")
        for name, (lower, upper) in self.bounds.items():
            if name not in self.source.space.names:
                known = ", ".join(self.source.space.names)
                raise KeyedError(f"bounds.{name}", f"unknown position; known are {known}")
            if lower >= upper:
                raise KeyedError(f"bounds.{name}", f"expected least and largest, got {lower:g} and {upper:g}")
        return self


SCHEMA = "primitives_node"


def schema_files(root: Path) -> dict[Path, str]:
    """Generates the JSON Schema file of this package, and returns the text by file path.

    Args:
        root: Folder of the workspace.
    """
    path = root / f"src/motion_primitives/schema/{SCHEMA}.schema.json"
    return {path: schema_text(explained(json_schema(PrimitivesNodeConfig, SCHEMA)))}
