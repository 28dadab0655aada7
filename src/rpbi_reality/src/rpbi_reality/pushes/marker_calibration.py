"""Fits the transforms from the markers of the motion capture to the links of the arm."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from robot_model.chain import Chain

from .motion_capture import MarkerPoses

BASE, HAND = "m1n6s300_link_base", "m1n6s300_link_6"
JOINTS = 6
ROTATION_M = 0.2
"""Length [m] that a rotation by 1 rad counts as."""
NOISE_M = 0.001
OUTLIER_M = 0.003
"""Distance [m] from which a frame counts less."""


class ArmKinematics:
    """Forward kinematics of the arm for many frames at once.

    Args:
        urdf: URDF of the arm.

    Raises:
        ConfigError: If the file cannot be read.
        UnknownNameError: If the arm lacks the links of base or hand.
        ValueError: If the arm does not have six joints.
    """

    def __init__(self, urdf: Path) -> None:
        self._joints = Chain(str(urdf), BASE, HAND).joints
        if sum(joint.is_moving for joint in self._joints) != JOINTS:
            raise ValueError(f"{urdf}: expected {JOINTS} joints from {BASE} to {HAND}")
        self.last_turn = Rotation.from_euler("xyz", self._joints[-1].rpy)
        """Orientation of the last joint's frame in its parent link."""

    def hand(self, angles: np.ndarray) -> MarkerPoses:
        """Returns the pose of the hand's link in the base link.

        Args:
            angles: Joint angles [rad], shape (n, 6).
        """
        position, rotation, index = np.zeros((len(angles), 3)), Rotation.identity(len(angles)), 0
        for joint in self._joints:
            position = position + rotation.apply(joint.xyz)
            rotation = rotation * Rotation.from_euler("xyz", joint.rpy)
            if joint.is_moving:
                rotation = rotation * Rotation.from_rotvec(np.outer(angles[:, index], joint.axis))
                index += 1
        return MarkerPoses(position, rotation)


class MarkerCalibration(NamedTuple):
    """Transforms of a session.

    Attributes:
        base_position: Position [m] of the base link in the frame of the motion capture, shape (3,).
        base_rotation: Its rotation vector [rad], shape (3,).
        marker_position: Position [m] of the hand's markers in the hand's link, shape (3,).
        marker_rotation: Their rotation vector [rad], shape (3,).
        zeros: Zeros of the joints [rad], shape (6,).
    """

    base_position: np.ndarray
    base_rotation: np.ndarray
    marker_position: np.ndarray
    marker_rotation: np.ndarray
    zeros: np.ndarray

    @classmethod
    def of(cls, flat: np.ndarray) -> MarkerCalibration:
        """Returns a calibration from its 18 numbers."""
        return cls(*np.split(flat, (3, 6, 9, 12)))

    def in_base(self, body: MarkerPoses) -> MarkerPoses:
        """Returns poses in the base link instead of the frame of the motion capture."""
        turn = Rotation.from_rotvec(self.base_rotation).inv()
        return MarkerPoses(turn.apply(body.position - self.base_position), turn * body.rotation)

    def hand(self, markers: MarkerPoses) -> MarkerPoses:
        """Returns the poses of the hand's link in the base link, from those of its markers."""
        inside = self.in_base(markers)
        rotation = inside.rotation * Rotation.from_rotvec(self.marker_rotation).inv()
        return MarkerPoses(inside.position - rotation.apply(self.marker_position), rotation)


EXPECTED = MarkerCalibration(np.array([0.0, 0.0, 0.05]), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(JOINTS))
SPREAD = MarkerCalibration(
    np.full(3, 0.02),
    np.radians([0.5, 0.5, 5.0]),  # the base is upright
    np.full(3, 0.03),
    np.radians(np.full(3, 5.0)),
    np.radians(np.full(JOINTS, 1.0)),
)
"""Standard deviations of `EXPECTED`: they decide what the data do not tell."""


class MarkerFit:
    """Fits a calibration and the angles of the moving joints to measured poses of the hand's markers.

    Args:
        arm: The arm.
        moving: Indices of the joints that move.
        path: Joint angles [rad] near those of the runs, shape (k, 6), for the first guess.
    """

    def __init__(self, arm: ArmKinematics, moving: list[int], path: np.ndarray) -> None:
        self._arm, self._moving, self._path = arm, moving, path

    def _residuals(self, calibration: np.ndarray, angles: np.ndarray, markers: MarkerPoses) -> np.ndarray:
        """Returns differences between model and markers [m], shape (n, 6)."""
        each = MarkerCalibration.of(calibration)
        joints = np.tile(each.zeros, (len(angles), 1))
        joints[:, self._moving] = angles
        hand = self._arm.hand(joints)
        base = Rotation.from_rotvec(each.base_rotation)
        position = each.base_position + base.apply(hand.position + hand.rotation.apply(each.marker_position))
        rotation = base * hand.rotation * Rotation.from_rotvec(each.marker_rotation)
        turn = (markers.rotation.inv() * rotation).as_rotvec()
        return np.hstack([position - markers.position, turn * ROTATION_M])

    def _by_calibration(self, calibration: np.ndarray, angles: np.ndarray, markers: MarkerPoses) -> np.ndarray:
        """Returns the derivatives of the residuals, shape (n, 6, 18)."""
        steps = 1e-5 * np.eye(len(calibration))
        sides = [[self._residuals(calibration + s * e, angles, markers) for s in (-1, 1)] for e in steps]
        return np.stack([(after - before) / 2e-5 for before, after in sides], 2)

    def _by_angles(self, calibration: np.ndarray, angles: np.ndarray, markers: MarkerPoses) -> np.ndarray:
        """Returns the derivatives of the residuals, shape (n, 6, joints)."""
        steps = 1e-5 * np.eye(len(self._moving))
        sides = [[self._residuals(calibration, angles + s * e, markers) for s in (-1, 1)] for e in steps]
        return np.stack([(after - before) / 2e-5 for before, after in sides], 2)

    def angles(
        self, calibration: MarkerCalibration, markers: MarkerPoses, first: np.ndarray | None = None
    ) -> np.ndarray:
        """Returns the angles [rad] of the moving joints that fit each frame best, shape (n, joints).

        Args:
            calibration: The transforms.
            markers: Measured poses of the hand's markers.
            first: First guess; by default, from the nearest pose of the path.
        """
        flat, angles = np.concatenate(calibration), self._nearest(markers) if first is None else first
        for _ in range(20):
            slopes = self._by_angles(flat, angles, markers)
            step = np.einsum("nji,ni->nj", np.linalg.pinv(slopes, 1e-3), self._residuals(flat, angles, markers))
            angles = angles - np.clip(step, -0.3, 0.3)
            if abs(step).max() < 1e-6:
                break
        return angles

    def _nearest(self, markers: MarkerPoses) -> np.ndarray:
        hand = self._arm.hand(self._path)
        known = np.hstack([hand.position + EXPECTED.base_position, hand.rotation.as_matrix().reshape(-1, 9) * 0.1])
        seen = np.hstack([markers.position, markers.rotation.as_matrix().reshape(-1, 9) * 0.1])
        distances = (known**2).sum(1) - 2.0 * seen @ known.T
        return self._path[distances.argmin(1)][:, self._moving]

    def calibration(
        self, markers: MarkerPoses, expected: MarkerCalibration = EXPECTED, spread: MarkerCalibration = SPREAD
    ) -> tuple[MarkerCalibration, np.ndarray]:
        """Fits a calibration by variable projection (Golub and Pereyra 1973): the angles follow from the calibration.

        Args:
            markers: Measured poses of the hand's markers.
            expected: Most likely calibration without data.
            spread: Standard deviations of `expected`.

        Returns:
            The calibration, and the distance between model and markers for each frame [m], shape (n,).
        """
        mean, deviation = np.concatenate(expected), np.concatenate(spread)
        flat, angles, weights = mean, self.angles(expected, markers), np.ones(len(markers.position))

        def rows(given: np.ndarray) -> np.ndarray:
            nonlocal angles
            angles = self.angles(MarkerCalibration.of(given), markers, angles)
            scaled = self._residuals(given, angles, markers) * weights[:, None] / NOISE_M
            return np.concatenate([scaled.ravel(), (given - mean) / deviation])

        def slopes(given: np.ndarray) -> np.ndarray:
            inner, outer = (by(given, angles, markers) for by in (self._by_angles, self._by_calibration))
            projected = outer - inner @ (np.linalg.pinv(inner, 1e-3) @ outer)
            scaled = projected * weights[:, None, None] / NOISE_M
            return np.vstack([scaled.reshape(-1, len(mean)), np.diag(1.0 / deviation)])

        for _ in range(3):  # frames in which the measurement jumps count less
            flat = least_squares(rows, flat, slopes, x_scale=deviation, xtol=1e-6, ftol=1e-6, max_nfev=30).x
            distance = np.linalg.norm(self._residuals(flat, angles, markers), axis=1)
            weights = (1.0 + (distance / OUTLIER_M) ** 2) ** -0.25
        return MarkerCalibration.of(flat), distance
