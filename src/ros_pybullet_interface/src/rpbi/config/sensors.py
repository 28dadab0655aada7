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

    type: Text = Field(description="Its class, as `module:Class`.")
    name: Name = Field(description="Its name, by which its body has no other sensor; topics are named after it.")
    hz: Hz = Field(description="Rate of its samples, in the world's time.")


class ContactsConfig(ConfigModel):
    """Publication of a body's contacts."""

    hz: Hz = Field(50.0, description="Rate of `rpbi/NAME/contacts`.")
    average: Switch = Field(
        False, description="Whether these are means over all ticks since the last sample, not those of the last tick."
    )
    arrows_hz: HzOrOff = Field(20.0, description="Rate of the arrows for RViz; 0 is off.")
    arrow_metres_per_newton: Annotated[Positive, Unit("m/N")] = Field(
        0.01, description="Length of an arrow by the force that it stands for."
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

    joint: Text = Field(description="Joint that it sits in.")
    hz: Hz | None = optional("Rate of its samples; without it, that of the joint states.")
    frame_id: FrameId | None = optional("Other name of the frame of the joint's child link, in which the samples are.")
    acting: Literal["parent_on_child", "child_on_parent"] = Field(
        "parent_on_child", description="Direction of action, which decides the sign."
    )
    low_pass_hz: Hz | None = optional("Frequency at which a first-order low-pass lets 71 % through.")
    noise_force_n: Annotated[Deviation, Unit("N")] = Field(
        (0.0, 0.0, 0.0), description="Standard deviation of the forces' noise."
    )
    noise_torque_nm: Annotated[Deviation, Unit("N m")] = Field(
        (0.0, 0.0, 0.0), description="Standard deviation of the moments' noise."
    )
    bias_force_n: Annotated[Vec3, Unit("N")] = Field((0.0, 0.0, 0.0), description="Offset of the forces.")
    bias_torque_nm: Annotated[Vec3, Unit("N m")] = Field((0.0, 0.0, 0.0), description="Offset of the moments.")
    seed: Count | None = optional("Seed of the noise; without it, one that follows from the names.")


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

    width: ImageSide = Field(640, description="Columns of the images.")
    height: ImageSide = Field(480, description="Rows of the images.")
    fov: float = Field(40.0, gt=0, lt=180, description="Vertical field of view.", json_schema_extra={"unit": "deg"})
    range: Annotated[tuple[PositiveMetres, PositiveMetres], Field(strict=False)] = Field(
        (0.01, 100.0), description="Nearest and farthest distance along the optical axis."
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
    hz: Hz = Field(30.0, description="Images in a second.")
    pointcloud: Switch = Field(False, description="Whether point clouds are published too.")
    synchronous: Switch = Field(False, description="Whether the simulation waits for every image.")
    depth_noise_m: NonNegativeMetres = Field(0.0, description="Standard deviation of the depths' noise.")
    depth_noise_growth_per_m: Annotated[NonNegative, Unit("1/m")] = Field(
        0.0, description="Growth of that deviation with the squared depth; about 0.0014 for a structured-light camera."
    )
    seed: Count | None = optional("Seed of the noise; without it, one that follows from the name.")
    intrinsics: IntrinsicsConfig = Field(IntrinsicsConfig(), description="Image size, field of view and range.")
    object_tf: ObjectTf = Field(description="TF frame of the camera: x right, y down, z forward.")
