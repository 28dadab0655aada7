"""Private parameters of the haptic node: force feedback, device and frames."""

from __future__ import annotations

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    FrameId,
    Hz,
    KeyedError,
    NonNegative,
    Positive,
    Switch,
    Text,
    Vec3,
)

from .coupling import Mode


class ForceFeedbackConfig(ConfigModel):
    """Parameters of the mapping from the handle's motion to the tool's, and of the forces rendered on the handle."""

    mode: Mode = Field(
        "wrench",
        description="Rendered force: `wrench` is the force on the tool, `coupling` is a spring between handle and "
        "tool.",
    )
    stiffness: Positive = Field(
        200.0, description="Stiffness of the spring between handle and tool, for `mode: coupling` [N/m]."
    )
    damping: NonNegative = Field(
        1.0, description="Damping between handle and tool, or of the handle alone with `mode: wrench` [N s/m]."
    )
    force_scale: NonNegative = Field(
        1.0, description="Ratio of the rendered force to the force on the tool, for `mode: wrench`."
    )
    force_axes: Vec3 = Field(
        (1.0, 1.0, 1.0), description="Factor of the rendered force for each axis: 1 renders the axis, 0 does not."
    )
    slew_n_per_s: Positive = Field(1000.0, description="Largest rate at which the rendered force may grow [N/s].")
    expiry_s: float = Field(
        0.016,
        gt=0.0,
        le=0.018,
        description="Time for which a sample of handle or tool is valid [s]. The time between two samples of the "
        "tool must be shorter.",
    )
    passivity: bool = Field(True, description="Whether the passivity controller changes forces.")
    energy_reserve_j: NonNegative = Field(1.0, description="Largest energy that the passivity observer stores [J].")
    energy_allowance_j: float = Field(
        0.0,
        ge=0.0,
        le=0.1,
        description="Energy that the device may give out in excess of the energy that was put in [J]; 0 is strictly "
        "passive.",
    )
    energy_refill_w: float = Field(
        0.0, ge=0.0, le=0.1, description="Power at which `energy_allowance_j` is restored [W]; 0 is strictly passive."
    )
    clutch_button: Count | None = Field(
        None,
        description="Index of the button that couples handle and tool while it is held. By default, handle and tool "
        "are always coupled.",
    )
    motion_scale: Vec3 = Field(
        (1.0, 1.0, 1.0),
        description="Displacement of the tool per metre of the handle's displacement, for each axis; 0 fixes the axis.",
    )
    yaw_deg: float = Field(0.0, description="Angle about z from the tool's axes to the handle's axes [deg].")
    way_low: Vec3 = Field(
        (-1.0, -1.0, -1.0), description="Least displacement of the target from its start, for each axis [m]."
    )
    way_high: Vec3 = Field(
        (1.0, 1.0, 1.0), description="Largest displacement of the target from its start, for each axis [m]."
    )
    max_target_speed: Positive = Field(0.5, description="Largest speed of the target [m/s].")

    @model_validator(mode="after")
    def _box_has_the_start(self) -> ForceFeedbackConfig:
        for low, high in zip(self.way_low, self.way_high):
            if not low <= 0.0 <= high:
                raise KeyedError("way_low", f"the start, 0, has to lie between way_low and way_high, got {low}, {high}")
        return self


class HapticNodeConfig(ForceFeedbackConfig):
    """Parameters of the haptic node: device, frames and forces."""

    device: Text = Field(
        "virtual", description="Haptic device: `virtual`, `scripted`, `haply`, `touch`, or `module:Class` of your own."
    )
    device_options: dict[str, object] = Field({}, description="Options of the device.")
    base_frame_id: FrameId = Field("haptic_base", description="TF frame of the device: x forward, y left, z up.")
    handle_frame_id: FrameId = Field("haptic_handle", description="TF frame of the device's handle.")
    parent_frame_id: FrameId = Field("rpbi/world", description="TF frame that defines the axes of target and force.")
    target_frame_id: FrameId | None = Field(
        None, description="TF frame that the handle moves. By default, no frame is broadcast."
    )
    tool_frame_id: FrameId | None = Field(
        None,
        description="TF frame of the tool, at which the target starts. With `mode: coupling`, the spring pulls the "
        "handle to the tool. By default, the target starts at the origin of `parent_frame_id`.",
    )
    hz: Hz = Field(250.0, description="Rate of pose, twist, force and target.")
    start_on_init: Switch = Field(True, description="Whether the device is opened at the start.")
    state_hz: Hz = Field(20.0, description="Rate of the state messages.")
