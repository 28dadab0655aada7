"""Offsets of segments from a T-pose that somebody stands in."""

import numpy as np

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import Array

from .segments import SEGMENTS, SegmentFrame
from .skeleton import about_z, heading_rad, inverse, multiply

MOST_RAD = np.radians(45.0)
"""Larger offsets mean that nobody stands in a T-pose."""


class Calibration:
    """Turns segments so that, in the pose it was made from, all are turned alike: upright, and ahead as the pelvis.

    Positions are left as they are.
    """

    def __init__(self) -> None:
        self._offsets: dict[int, Array] = {}

    @property
    def people(self) -> list[int]:
        """Who is calibrated."""
        return sorted(self._offsets)

    def fit(self, frame: SegmentFrame) -> str:
        """Takes a frame, not calibrated itself, as the T-pose of its person; returns what it found, in words.

        Raises:
            InterfaceError: If it is no T-pose.
        """
        ahead = np.tile(about_z(heading_rad(frame.quats_xyzw[0])), (len(SEGMENTS), 1))
        offsets = multiply(inverse(frame.quats_xyzw), ahead)
        angles = 2.0 * np.arccos(np.clip(np.abs(offsets[:, 3]), 0.0, 1.0))
        worst = int(angles.argmax())
        found = f"{SEGMENTS[worst]} is {np.degrees(angles[worst]):.0f} deg off a T-pose"
        if angles[worst] > MOST_RAD:
            raise InterfaceError(f"person {frame.person}: {found}; stand upright with both arms out to the sides")
        self._offsets = {**self._offsets, frame.person: offsets}
        return f"person {frame.person}: at most, {found}"

    def clear(self) -> None:
        """Forgets all offsets."""
        self._offsets = {}

    def apply(self, frame: SegmentFrame) -> SegmentFrame:
        """Returns a frame with the offsets of its person."""
        offsets = self._offsets.get(frame.person)
        return frame if offsets is None else frame._replace(quats_xyzw=multiply(frame.quats_xyzw, offsets))
