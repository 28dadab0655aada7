"""Calculates with orientations of segments, given as quaternions (n x 4), x, y, z, w, and calibrates orientations."""

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import Array

from .segments import SEGMENTS, SegmentFrame

MAX_OFFSET_RAD = np.radians(45.0)
"""Largest angle between a segment and its orientation in a T-pose [rad]. Beyond it, the calibration is refused."""


def multiply(a: Array, b: Array) -> Array:
    """Returns the products a b of quaternions (n x 4): rotation by b, then by a."""
    return np.asarray((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat())


def inverse(quats: Array) -> Array:
    """Returns the inverses of unit quaternions (n x 4)."""
    return quats * (-1.0, -1.0, -1.0, 1.0)


def rotate(quats: Array, vectors: Array) -> Array:
    """Returns vectors (n x 3), each rotated by its quaternion (n x 4)."""
    return np.asarray(Rotation.from_quat(quats).apply(vectors))


def heading_rad(quat: Array) -> float:
    """Returns the rotation angle about z of a unit quaternion (4) [rad], by swing-twist decomposition."""
    return float(2.0 * np.arctan2(quat[2], quat[3]))


def about_z(angle_rad: float) -> Array:
    """Returns the quaternion (4) of a rotation about z by an angle [rad]."""
    return np.array((0.0, 0.0, np.sin(angle_rad / 2.0), np.cos(angle_rad / 2.0)))


class Calibration:
    """Corrects the orientations of segments by constant offsets, one for each segment and person.

    In the calibration pose, all corrected segments are upright and have the heading of the pelvis. Positions stay
    unchanged.
    """

    def __init__(self) -> None:
        self._offsets: dict[int, Array] = {}

    @property
    def people(self) -> list[int]:
        """Numbers of the calibrated people."""
        return sorted(self._offsets)

    def fit(self, frame: SegmentFrame) -> str:
        """Calibrates a person with an uncalibrated frame in the T-pose. Returns a summary for the user.

        Raises:
            InterfaceError: If the frame is not a T-pose.
        """
        ahead = np.tile(about_z(heading_rad(frame.quats_xyzw[0])), (len(SEGMENTS), 1))
        offsets = multiply(inverse(frame.quats_xyzw), ahead)
        angles = 2.0 * np.arccos(np.clip(np.abs(offsets[:, 3]), 0.0, 1.0))
        worst = int(angles.argmax())
        found = f"{SEGMENTS[worst]} is {np.degrees(angles[worst]):.0f} deg off a T-pose"
        if angles[worst] > MAX_OFFSET_RAD:
            raise InterfaceError(f"person {frame.person}: {found}; stand upright with both arms out to the sides")
        self._offsets = {**self._offsets, frame.person: offsets}
        return f"person {frame.person}: at most, {found}"

    def clear(self) -> None:
        """Removes the offsets of all people."""
        self._offsets = {}

    def apply(self, frame: SegmentFrame) -> SegmentFrame:
        """Returns a frame with corrected orientations, or the unchanged frame if its person is not calibrated."""
        offsets = self._offsets.get(frame.person)
        return frame if offsets is None else frame._replace(quats_xyzw=multiply(frame.quats_xyzw, offsets))
