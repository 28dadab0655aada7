"""Private parameters of `interactive_target_node.py`."""

from __future__ import annotations

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, FrameId, Hz, Position, PositiveMetres, Quat


class InteractiveTargetConfig(ConfigModel):
    """A TF frame that is dragged in RViz."""

    parent_frame_id: FrameId = Field(description="The frame that it is in.")
    child_frame_id: FrameId = Field(description="Its name.")
    position: Position = Field((0.0, 0.0, 0.0), description="Where it is at first.")
    quat_xyzw: Quat = Field((0.0, 0.0, 0.0, 1.0), description="How it is turned at first.")
    size_m: PositiveMetres = Field(0.2, description="Size of the handles.")
    hz: Hz = Field(50.0, description="How often it is broadcast, in wall time.")
