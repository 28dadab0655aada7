"""Private parameters of the haptic node."""

from pydantic import Field

from custom_ros_tools.schema import FrameId, Hz, Switch, Text

from .controller import ForceFeedbackConfig


class HapticNodeConfig(ForceFeedbackConfig):
    """Device, frames and forces of the haptic node."""

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
