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

    mode: Mode = Field("wrench", description="Rendered force: the force on the tool, or a spring to its position.")
    stiffness: Positive = Field(200.0, description="Stiffness of the spring of `mode: coupling` [N/m].")
    damping: NonNegative = Field(
        1.0, description="Damping between handle and tool; with `mode: wrench`, of the handle alone [N s/m]."
    )
    force_scale: NonNegative = Field(1.0, description="Factor of forces of `mode: wrench`.")
    force_axes: Vec3 = Field((1.0, 1.0, 1.0), description="1 for each axis that is rendered, 0 for the others.")
    slew_n_per_s: Positive = Field(1000.0, description="Largest rate at which a force may grow [N/s].")
    expiry_s: float = Field(
        0.016,
        gt=0.0,
        le=0.018,
        description="Time for which a sample of handle or tool is valid [s]; the tool must be sampled more often.",
    )
    passivity: bool = Field(True, description="Whether the passivity controller changes forces.")
    energy_reserve_j: NonNegative = Field(1.0, description="Largest energy that the observer stores [J].")
    energy_allowance_j: float = Field(
        0.0,
        ge=0.0,
        le=0.1,
        description="Energy that may be given out once without having been put in; 0 is strictly passive.",
    )
    energy_refill_w: float = Field(
        0.0, ge=0.0, le=0.1, description="Power at which that allowance is restored [W]; 0 is strictly passive."
    )
    clutch_button: Count | None = Field(None, description="Index of the button to hold; without it, always engaged.")
    motion_scale: Vec3 = Field(
        (1.0, 1.0, 1.0), description="Displacement of the tool for each metre of the handle; 0 holds."
    )
    yaw_deg: float = Field(
        0.0, description="Angle by which the handle's axes are rotated about z relative to the tool's."
    )
    way_low: Vec3 = Field(
        (-1.0, -1.0, -1.0), description="Least displacement of the target from its start, in its axes [m]."
    )
    way_high: Vec3 = Field((1.0, 1.0, 1.0), description="Most [m].")
    max_target_speed: Positive = Field(0.5, description="Largest speed of the target [m/s].")

    @model_validator(mode="after")
    def _box_has_the_start(self) -> ForceFeedbackConfig:
        for low, high in zip(self.way_low, self.way_high):
            if not low <= 0.0 <= high:
                raise KeyedError("way_low", f"the start, 0, has to lie between way_low and way_high, got {low}, {high}")
        return self


class HapticNodeConfig(ForceFeedbackConfig):
    """Parameters of the haptic node: device, frames and forces."""

    device: Text = Field("virtual", description="virtual, scripted, haply, touch, or module:Class of your own.")
    device_options: dict[str, object] = Field({}, description="Options of the device.")
    base_frame_id: FrameId = Field("haptic_base", description="TF frame of the device: x forward, y left, z up.")
    handle_frame_id: FrameId = Field("haptic_handle", description="TF frame of its handle.")
    parent_frame_id: FrameId = Field("rpbi/world", description="TF frame whose axes target and force are in.")
    target_frame_id: FrameId | None = Field(None, description="TF frame that the handle moves; none without it.")
    tool_frame_id: FrameId | None = Field(
        None, description="TF frame of the tool: the target starts there; with `mode: coupling` the spring pulls to it."
    )
    hz: Hz = Field(250.0, description="Rate at which pose, twist, force and target are published.")
    start_on_init: Switch = Field(True, description="Whether the device is opened at the start.")
    state_hz: Hz = Field(20.0, description="Rate at which the state is published.")
