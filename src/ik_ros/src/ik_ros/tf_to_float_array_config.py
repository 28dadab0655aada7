"""Private parameters of `tf_to_floatarray_node.py`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from custom_ros_tools.schema import FrameId

from .setup_parameters import TargetParameters


class TfToFloatArrayConfig(TargetParameters):
    """Which transform becomes numbers, and which numbers."""

    parent_frame_id: FrameId = Field(description="The frame that the pose is in.")
    child_frame_id: FrameId = Field(description="The frame whose pose it is.")
    mode: Literal["pos", "pos+quat", "pos+eul"] = Field(
        "pos+quat",
        description="x, y, z [m]; and then a quaternion x, y, z, w, or roll, pitch, yaw [rad], or nothing.",
    )
