"""The task `frame_position`: moves a link to a position."""

from collections.abc import Sequence

from robot_model.geometry import Pose

from .frame_task import FrameTask


class FramePosition(FrameTask):
    """Moves the origin of a link to a position x, y, z [m]. The orientation of the link is not constrained."""

    available = ("x", "y", "z")
    goal_words = "a position (x, y, z)"

    def pose_of(self, values: Sequence[float]) -> Pose:
        """Returns the goal as a pose whose axes are parallel to the axes of the base frame, see `FrameTask`."""
        if len(values) != 3:
            raise ValueError(f"expected {self.goal_words}, got {list(values)}")
        x, y, z = values
        return Pose((x, y, z))
