"""Keys of an attachment in YAML."""

from typing import Annotated, Literal

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Name, Position, Positive, Quat, Text, Unit, optional
from rpbi.geometry import Pose


class AttachmentPose(ConfigModel):
    """Where an attachment is on a link, in the link's URDF frame."""

    position: Position = Field((0.0, 0.0, 0.0), description="Its position.")
    orientation: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Its orientation, x, y, z, w.")

    @property
    def pose(self) -> Pose:
        """The same as a pose."""
        return Pose(self.position, self.orientation)


class AttachmentConfig(ConfigModel):
    """An attachment: it holds a link of one body to a link of another, as a magnet or a tool changer does."""

    name: Name = Field(description="Its name, by which it is detached.")
    parent: Text = Field(description="The parent: an object, or one of its links as NAME/LINK.")
    child: Text = Field(description="The child: likewise.")
    kind: Literal["fixed", "ball"] = Field("fixed", description="`fixed` holds the pose, `ball` the position alone.")
    parent_pose: AttachmentPose | None = optional(
        "Its place on the parent; by default the present one, so that nothing moves."
    )
    child_pose: AttachmentPose | None = optional(
        "Its place on the child; its origin if neither is given. If both are, they are pulled together."
    )
    max_force: Annotated[Positive, Unit("N")] | None = optional("Force that it breaks beyond; none by default.")
