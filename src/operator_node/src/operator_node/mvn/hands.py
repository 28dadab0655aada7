"""The hands of a person as axes of an input device."""

import numpy as np

from custom_ros_tools.transforms import Array

from .segments import SegmentFrame
from .skeleton import INDEX, about_z, heading_rad, inverse, rotate

AXES = tuple(f"{side}_{axis}" for side in ("right", "left") for axis in "xyz")
SHORTEST_ARM_M = 0.05
_HANDS = [INDEX["RightHand"], INDEX["LeftHand"]]
_ARMS = np.array([[INDEX[f"{side}{bone}"] for bone in ("UpperArm", "ForeArm", "Hand")] for side in ("Right", "Left")])


class HandAxes:
    """How far the hands are, forward, left and up, from where they were when they were engaged.

    They are seen from the pelvis, whichever way it looks, and counted in lengths of the arm.
    """

    def __init__(self) -> None:
        self._engaged: tuple[Array, Array] | None = None
        """Where the hands were, and how long the arms were then."""

    def release(self) -> None:
        """Has the next frame engage the hands where they are then."""
        self._engaged = None

    def axes(self, frame: SegmentFrame) -> tuple[float, ...]:
        """Returns the numbers of `AXES`, each in [-1, 1]; zeros of the frame that engages."""
        places = _places(frame)
        if self._engaged is None:
            lengths = np.linalg.norm(np.diff(frame.positions[_ARMS], axis=1), axis=2).sum(axis=1)
            self._engaged = places, np.maximum(lengths, SHORTEST_ARM_M)[:, None]
        before, lengths = self._engaged
        return tuple(np.clip((places - before) / lengths, -1.0, 1.0).ravel().tolist())


def _places(frame: SegmentFrame) -> Array:
    """Returns both hands, seen from the pelvis [m]."""
    ahead = np.tile(about_z(heading_rad(frame.quats_xyzw[0])), (2, 1))
    return rotate(inverse(ahead), frame.positions[_HANDS] - frame.positions[0])
