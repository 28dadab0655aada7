"""The position of a link."""

from collections.abc import Sequence

from robot_model.geometry import Pose

from .frame_task import FrameTask


class FramePosition(FrameTask):
    """Moves the origin of a link to a position x, y, z [m]; its orientation is free."""

    available = ("x", "y", "z")
    goal_words = "a position (x, y, z)"

    def pose_of(self, values: Sequence[float]) -> Pose:
        """See `FrameTask`; the axes of the goal are those of the base."""
        if len(values) != 3:
            raise ValueError(f"expected {self.goal_words}, got {list(values)}")
        x, y, z = values
        return Pose((x, y, z))
