"""YAML keys of sensors."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from custom_ros_tools.schema import (
    AlsoTakes,
    ConfigModel,
    Count,
    FrameId,
    Hz,
    HzOrOff,
    KeyedError,
    Name,
    NonNegative,
    NonNegativeMetres,
    Positive,
    PositiveMetres,
    Switch,
    Text,
    Unit,
    Vec3,
    optional,
)

from .pybullet_models import ObjectTf


class SensorConfig(ConfigModel):
    """Keys that every entry of a body's `sensors` has; a sensor adds its own keys in a subclass."""

    model_config = ConfigDict(json_schema_extra={"additionalProperties": True})  # subclasses have further keys

    type: Text = Field(description="Class of the sensor, as `module:Class`.")
    name: Name = Field(description="Name of the sensor, unique on its body; topics are named after it.")
    hz: Hz = Field(description="Rate of the samples, in simulated time.")


class ContactsConfig(ConfigModel):
    """Publication of a body's contacts."""

    hz: Hz = Field(50.0, description="Rate of the messages on `rpbi/NAME/contacts`.")
    average: Switch = Field(
        False,
        description="Whether contact forces are averaged over all ticks since the last message, otherwise over the "
        "last tick only.",
    )
    arrows_hz: HzOrOff = Field(20.0, description="Rate of the arrows that RViz shows; 0 is off.")
    arrow_metres_per_newton: Annotated[Positive, Unit("m/N")] = Field(
        0.01, description="Length of an arrow per newton of contact force."
    )


def _one_for_each_axis(given: Any) -> Any:
    return (given, given, given) if isinstance(given, (int, float)) and not isinstance(given, bool) else given


Deviation = Annotated[
    tuple[NonNegative, NonNegative, NonNegative],
    Field(strict=False),
    BeforeValidator(_one_for_each_axis),
    AlsoTakes({"type": "number", "minimum": 0}),
]
"""Standard deviations along x, y and z: three numbers, or one number for all axes."""


class ForceTorqueConfig(ConfigModel):
    """A force-torque sensor in a joint."""

    joint: Text = Field(description="Joint that contains the sensor.")
    hz: Hz | None = optional("Rate of the samples. By default, the rate of the joint states.")
    frame_id: FrameId | None = optional(
        "Name of the frame in messages. By default, the TF frame of the joint's child link. Samples are always in "
        "the axes of this link."
    )
    acting: Literal["parent_on_child", "child_on_parent"] = Field(
        "parent_on_child",
        description="Whether the force and torque of the parent link on the child link are measured, or those of the "
        "child link on the parent link.",
    )
    low_pass_hz: Hz | None = optional(
        "Cut-off frequency (-3 dB) of a first-order low-pass filter. By default, samples are not filtered."
    )
    noise_force_n: Annotated[Deviation, Unit("N")] = Field(
        (0.0, 0.0, 0.0),
        description="Standard deviation of the force noise along x, y and z, or one number for all axes.",
    )
    noise_torque_nm: Annotated[Deviation, Unit("N m")] = Field(
        (0.0, 0.0, 0.0),
        description="Standard deviation of the torque noise about x, y and z, or one number for all axes.",
    )
    bias_force_n: Annotated[Vec3, Unit("N")] = Field((0.0, 0.0, 0.0), description="Constant offset of the force.")
    bias_torque_nm: Annotated[Vec3, Unit("N m")] = Field((0.0, 0.0, 0.0), description="Constant offset of the torque.")
    seed: Count | None = optional("Seed of the noise. By default, computed from the name of the sensor.")


def _from_name(given: Any) -> Any:
    return {"joint": given} if isinstance(given, str) else given


ForceTorqueEntry = Annotated[
    ForceTorqueConfig, BeforeValidator(_from_name), AlsoTakes({"type": "string", "minLength": 1})
]
"""A sensor as a mapping with its keys, or only the name of the sensor's joint."""


FIRST_TOPIC_NAME = "camera"
"""Name of the first camera in topics, independent of its configured name."""

ImageSide = Annotated[int, Field(gt=0, le=8192, json_schema_extra={"unit": "px"})]


class IntrinsicsConfig(ConfigModel):
    """Size and field of view of the images."""

    width: ImageSide = Field(640, description="Width of the images.")
    height: ImageSide = Field(480, description="Height of the images.")
    fov: float = Field(40.0, gt=0, lt=180, description="Vertical field of view.", json_schema_extra={"unit": "deg"})
    range: Annotated[tuple[PositiveMetres, PositiveMetres], Field(strict=False)] = Field(
        (0.01, 100.0), description="Nearest and farthest visible distance along the optical axis."
    )

    @model_validator(mode="after")
    def _near_before_far(self) -> IntrinsicsConfig:
        near, far = self.range
        if near >= far:
            raise KeyedError("range", f"expected [near, far] with near < far [m], got [{near:g}, {far:g}]")
        return self


class RgbdSensorConfig(ConfigModel):
    """A camera that takes colour, depth and segmentation images."""

    name: Name = Field(description="Name of the camera, unique among all objects.")
    hz: Hz = Field(30.0, description="Rate of the images, in simulated time.")
    pointcloud: Switch = Field(False, description="Whether the camera also publishes point clouds.")
    synchronous: Switch = Field(False, description="Whether the simulation waits for every image.")
    depth_noise_m: NonNegativeMetres = Field(0.0, description="Standard deviation of the depth noise.")
    depth_noise_growth_per_m: Annotated[NonNegative, Unit("1/m")] = Field(
        0.0,
        description="Growth of the depth noise: this value times the squared depth is added to the standard "
        "deviation. About 0.0014 for a structured-light camera.",
    )
    seed: Count | None = optional("Seed of the depth noise. By default, computed from the name of the camera.")
    intrinsics: IntrinsicsConfig = Field(IntrinsicsConfig(), description="Image size, field of view and range.")
    object_tf: ObjectTf = Field(description="TF frame of the camera: x right, y down, z forward.")
