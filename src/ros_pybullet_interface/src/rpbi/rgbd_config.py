"""What `rgbd_sensor` of the main YAML file may say."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    Hz,
    KeyedError,
    Name,
    NonNegative,
    PositiveMetres,
    Switch,
    Unit,
)

from .pybullet_models import ObjectTf

FIRST_TOPIC_NAME = "camera"
"""What the first camera is called in topics, whatever its name."""

ImageSide = Annotated[int, Field(gt=0, le=8192, json_schema_extra={"unit": "px"})]


class IntrinsicsConfig(ConfigModel):
    """What the camera sees of the space before it."""

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
    """A camera of colour, depth and segmentation."""

    name: Name = Field(description="Name of the camera, unique among all objects.")
    hz: Hz = Field(30.0, description="Images in a second.")
    pointcloud: Switch = Field(False, description="Whether point clouds are published too.")
    synchronous: Switch = Field(False, description="Whether the simulation waits for every image.")
    depth_noise_m: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="Standard deviation of the depths' noise."
    )
    depth_noise_growth_per_m: Annotated[NonNegative, Unit("1/m")] = Field(
        0.0, description="What the squared depth adds to that deviation; about 0.0014 for a structured-light camera."
    )
    seed: Count | None = Field(None, description="Seed of the noise; without it, one that follows from the name.")
    intrinsics: IntrinsicsConfig = Field(IntrinsicsConfig(), description="Image size, field of view and range.")
    object_tf: ObjectTf = Field(description="TF frame of the camera: x right, y down, z forward.")
