"""What YAML may say of a force-torque sensor."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from custom_ros_tools.schema import AlsoTakes, ConfigModel, Count, FrameId, Hz, NonNegative, Text, Unit, Vec3


def _one_for_each_axis(given: Any) -> Any:
    return (given, given, given) if isinstance(given, (int, float)) and not isinstance(given, bool) else given


Deviation = Annotated[
    tuple[NonNegative, NonNegative, NonNegative],
    Field(strict=False),
    BeforeValidator(_one_for_each_axis),
    AlsoTakes({"type": "number", "minimum": 0}),
]
"""A standard deviation: one number, or one of each axis."""


class ForceTorqueConfig(ConfigModel):
    """A force-torque sensor in a joint."""

    joint: Text = Field(description="Joint that it sits in.")
    hz: Hz | None = Field(None, description="Rate of its samples; without it, that of the joint states.")
    frame_id: FrameId | None = Field(
        None, description="Other name of the frame of the joint's child link, in which the samples are."
    )
    acting: Literal["parent_on_child", "child_on_parent"] = Field(
        "parent_on_child", description="Who acts on whom; it decides the sign."
    )
    low_pass_hz: Hz | None = Field(None, description="Frequency at which a first-order low-pass lets 71 % through.")
    noise_force_n: Annotated[Deviation, Unit("N")] = Field(
        (0.0, 0.0, 0.0), description="Standard deviation of the forces' noise."
    )
    noise_torque_nm: Annotated[Deviation, Unit("N m")] = Field(
        (0.0, 0.0, 0.0), description="Standard deviation of the moments' noise."
    )
    bias_force_n: Annotated[Vec3, Unit("N")] = Field((0.0, 0.0, 0.0), description="What is added to the forces.")
    bias_torque_nm: Annotated[Vec3, Unit("N m")] = Field((0.0, 0.0, 0.0), description="What is added to the moments.")
    seed: Count | None = Field(None, description="Seed of the noise; without it, one that follows from the names.")


def _from_name(given: Any) -> Any:
    return {"joint": given} if isinstance(given, str) else given


ForceTorqueEntry = Annotated[
    ForceTorqueConfig, BeforeValidator(_from_name), AlsoTakes({"type": "string", "minLength": 1})
]
"""A sensor with all of its keys, or only the name of its joint."""
