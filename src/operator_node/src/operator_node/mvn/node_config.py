"""What the topics of MVN are told, as private parameters."""

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, FrameId, Text


class MvnTopicsConfig(ConfigModel):
    """How people are published."""

    parent_frame_id: FrameId = Field("rpbi/world", description="TF frame that MVN's world is put into.")
    recording_folder: Text = Field("~/mvn", description="Where `mvn/record` puts its files.")
