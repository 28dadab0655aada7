"""Parameters of the nodes of the avatar."""

from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, FrameId, Name, Positive, Seconds

Place3 = Annotated[tuple[float, float, float], Field(strict=False)]


class AvatarParameters(ConfigModel):
    """Private parameters of `avatar_node.py`."""

    robot_name: Name = Field("human", description="The avatar: a robot of the simulator with the joints of a person.")
    parent_frame_id: FrameId = Field("rpbi/world", description="TF frame in which the segments are given.")
    base_frame_id: FrameId = Field("human/base", description="TF frame that the avatar's base follows.")
    place: Place3 | None = Field(
        None, description="Initial place of the avatar: x, y [m], yaw [rad]; by default that of the person."
    )
    input_timeout_s: Seconds = Field(
        0.5, description="Time without segments after which a warning reports that the avatar holds its pose."
    )
    max_joint_speed: Positive = Field(10.0, description="Largest speed of each hinge [rad/s].")
    max_speed: Positive = Field(3.0, description="Largest speed of the pelvis [m/s].")
    max_angular_speed: Positive = Field(6.0, description="Largest angular speed of the pelvis [rad/s].")


class SegmentForcesParameters(ConfigModel):
    """Private parameters of `segment_forces_node.py`."""

    robot_name: Name = Field("human", description="The avatar; its YAML needs `contacts`.")
