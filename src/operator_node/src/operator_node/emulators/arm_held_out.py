"""Motion of a person who swings the right arm forward, holds the arm out and sways a little, as 23 segments."""

import math

import numpy as np

from operator_node.avatar.anthropometry import Array, segment_offsets
from operator_node.avatar.joints import segment_frame
from operator_node.mvn.segments import SegmentFrame

RAISING_S = 3.0
"""Time in which the arm is lowered from the T-pose, swung forward, and raised. Each phase takes a third [s]."""
ARMS_DOWN_RAD = 1.3
SWAY_RAD, SWAY_HZ = 0.02, 0.4
"""Amplitude and frequency of the held arm's sway."""
LEVEL = np.array((0.0, 0.0, 0.0, 1.0))


class ArmHeldOut:
    """Motion of a person, who faces x, as a function of time. The pose in which the arm is held is random.

    Args:
        height_m: Body height [m].
        seed: Seed of the arm's random pose.
        start: Position of the person, x and y [m].
        t_pose_s: Time for which the person stands in the T-pose at the start [s].
    """

    def __init__(
        self, height_m: float = 1.75, seed: int = 0, start: tuple[float, float] = (0.0, 0.0), t_pose_s: float = 0.0
    ) -> None:
        random = np.random.default_rng(seed)
        self._offsets, self._t_pose_s = segment_offsets(height_m), t_pose_s
        self._hips = np.array((*start, 0.53 * height_m))
        self._held = np.radians((random.uniform(-8, 8), random.uniform(74, 86), random.uniform(5, 25)))
        self._phase = random.uniform(0.0, 2.0 * math.pi)
        self.t_pose: Array = segment_frame(self._offsets, self._hips, LEVEL, {}).positions
        """Origins of the segments in the T-pose (23 x 3) [m]. All segments then have the orientation of the world."""

    def frame(self, time_s: float) -> SegmentFrame:
        """Returns the segments at a time [s]."""
        since_s = time_s - self._t_pose_s
        thirds = 3.0 * since_s / RAISING_S
        # The arm swings forward before it is raised: raised sideways, the hand could hit anybody beside the person
        lowered, forward, raised = (_smooth(thirds - begun) for begun in range(3))
        lowered = lowered if self._t_pose_s else 1.0
        up, ahead, elbow = self._held
        sway = SWAY_RAD * math.sin(2.0 * math.pi * SWAY_HZ * time_s + self._phase)
        hinges = {
            "jLeftShoulder_rotx": -lowered * ARMS_DOWN_RAD,
            "jRightShoulder_rotx": (1.0 - raised) * lowered * ARMS_DOWN_RAD + raised * up + sway,
            "jRightShoulder_rotz": forward * ahead + sway,
            "jRightElbow_rotz": forward * elbow,
        }
        return segment_frame(self._offsets, self._hips, LEVEL, hinges)

    def pose(self, time_s: float) -> tuple[Array, Array]:
        """Returns the segments' origins (23 x 3) [m] and orientations (23 x 4), x, y, z, w, at a time [s]."""
        frame = self.frame(time_s)
        return frame.positions, frame.quats_xyzw


def _smooth(share: float) -> float:
    """Returns a smooth step from 0 to 1 between the arguments 0 and 1."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
