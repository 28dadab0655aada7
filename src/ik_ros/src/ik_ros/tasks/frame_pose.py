"""The task `frame_pose`: moves a link to a pose."""

from .frame_task import FrameTask


class FramePose(FrameTask):
    """Moves a link to a pose, given as position x, y, z [m] and quaternion x, y, z, w."""
