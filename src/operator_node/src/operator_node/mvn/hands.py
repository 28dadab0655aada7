"""The hands of a person as axes of an input device."""

import numpy as np

from custom_ros_tools.transforms import Array

from .segments import SegmentFrame
from .skeleton import INDEX, about_z, heading_rad, inverse, rotate

AXES = tuple(f"{side}_{axis}" for side in ("right", "left") for axis in "xyz")
MIN_ARM_M = 0.05
_HANDS = [INDEX["RightHand"], INDEX["LeftHand"]]
_ARMS = np.array([[INDEX[f"{side}{bone}"] for bone in ("UpperArm", "ForeArm", "Hand")] for side in ("Right", "Left")])


class HandAxes:
    """Displacements of the hands forwards, left and up since they were engaged.

    They are relative to the pelvis and its heading, in arm lengths.
    """

    def __init__(self) -> None:
        self._engaged: tuple[Array, Array] | None = None
        """Positions of the hands, and lengths of the arms, when they were engaged."""

    def release(self) -> None:
        """Disengages the hands; the next frame engages them at their place then."""
        self._engaged = None

    def axes(self, frame: SegmentFrame) -> tuple[float, ...]:
        """Returns the numbers of `AXES`, each in [-1, 1]; zeros for the frame that engages."""
        places = _places(frame)
        if self._engaged is None:
            lengths = np.linalg.norm(np.diff(frame.positions[_ARMS], axis=1), axis=2).sum(axis=1)
            self._engaged = places, np.maximum(lengths, MIN_ARM_M)[:, None]
        before, lengths = self._engaged
        return tuple(np.clip((places - before) / lengths, -1.0, 1.0).ravel().tolist())


def _places(frame: SegmentFrame) -> Array:
    """Returns the positions of both hands relative to the pelvis and its heading [m]."""
    ahead = np.tile(about_z(heading_rad(frame.quats_xyzw[0])), (2, 1))
    return rotate(inverse(ahead), frame.positions[_HANDS] - frame.positions[0])
