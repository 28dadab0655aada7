"""The task `frame_orientation`: turns a link to an orientation."""

from collections.abc import Sequence

from robot_model.geometry import Pose

from .frame_task import FrameTask


class FrameOrientation(FrameTask):
    """Turns a link to an orientation, given as a quaternion x, y, z, w. The position of the link is not constrained."""

    available = ("rx", "ry", "rz")
    goal_words = "a quaternion (x, y, z, w) that is not zero"

    def pose_of(self, values: Sequence[float]) -> Pose:
        if len(values) != 4:
            raise ValueError(f"expected {self.goal_words}, got {list(values)}")
        return super().pose_of((0.0, 0.0, 0.0, *values))
