"""Orientations of segments: arrays of quaternions (n x 4, x, y, z, w), and the calibration in a T-pose."""

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import Array

from .segments import SEGMENTS, SegmentFrame

MAX_OFFSET_RAD = np.radians(45.0)
"""Largest offset of a segment; beyond it the pose is rejected as no T-pose."""


def multiply(a: Array, b: Array) -> Array:
    """Returns the products a b: rotation by b, then by a."""
    return np.asarray((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat())


def inverse(quats: Array) -> Array:
    """Returns the inverse of unit quaternions."""
    return quats * (-1.0, -1.0, -1.0, 1.0)


def rotate(quats: Array, vectors: Array) -> Array:
    """Returns vectors (n x 3) rotated by quaternions."""
    return np.asarray(Rotation.from_quat(quats).apply(vectors))


def heading_rad(quat: Array) -> float:
    """Returns the rotation of a unit quaternion (4) about z, as the twist of its swing-twist decomposition [rad]."""
    return float(2.0 * np.arctan2(quat[2], quat[3]))


def about_z(angle_rad: float) -> Array:
    """Returns a rotation about z, as a quaternion (4)."""
    return np.array((0.0, 0.0, np.sin(angle_rad / 2.0), np.cos(angle_rad / 2.0)))


class Calibration:
    """Corrects orientations such that, in the calibrated pose, all segments are upright and face the heading of the
    pelvis.

    Positions stay unchanged.
    """

    def __init__(self) -> None:
        self._offsets: dict[int, Array] = {}

    @property
    def people(self) -> list[int]:
        """Numbers of the calibrated people."""
        return sorted(self._offsets)

    def fit(self, frame: SegmentFrame) -> str:
        """Calibrates a person with a frame, which must be uncalibrated; returns a summary.

        Raises:
            InterfaceError: If it is no T-pose.
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
        """Removes all offsets."""
        self._offsets = {}

    def apply(self, frame: SegmentFrame) -> SegmentFrame:
        """Returns a frame with the offsets of its person applied."""
        offsets = self._offsets.get(frame.person)
        return frame if offsets is None else frame._replace(quats_xyzw=multiply(frame.quats_xyzw, offsets))
