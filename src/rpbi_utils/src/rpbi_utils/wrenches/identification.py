"""Identifies a payload's mass and centre of mass, and a sensor's offsets, from wrenches in several poses.

At rest, the sensor reports f = f0 - m g and t = t0 + m c x (-g) = t0 + g x (m c), with gravity g and the centre of mass
c in the sensor's axes. The forces determine the mass m and the offset f0. The torques determine the first moment m c
and the offset t0. Both are linear least-squares problems.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from robot_model.geometry import Vector

from .calibration import Array, CalibrationParameters, PayloadConfig, listed

MIN_POSES = 3
MIN_SPREAD = 0.1
"""Smallest root mean square of the variation of gravity's direction across its main direction of variation [rad]."""
MIN_SIGNIFICANCE = 3.0
"""Smallest ratio of the mass to the standard deviation of the mass."""
MIN_MASS_KG = 1e-3


class UndeterminedError(ValueError):
    """The poses do not determine the payload; the message says what is missing."""


class PoseSample(NamedTuple):
    """Mean wrench in one pose of the sensor.

    Attributes:
        wrench: Mean force and torque [N, N m], shape (6,).
        gravity: Gravity vector in the sensor's axes [m/s^2].
    """

    wrench: Array
    gravity: Vector


class Identification(NamedTuple):
    """An identified payload.

    Attributes:
        payload: The payload, with the sensor's offsets.
        mass_sd: Standard deviation of the mass [kg], scaled so that the true mass is within two standard deviations
            in 95 % of cases, even with few poses.
        centre_sd: Largest standard deviation of the centre's coordinates [m], scaled in the same way. The uncertainty
            of the mass is included.
        force_residual: Root mean square of the residual forces [N].
        torque_residual: Root mean square of the residual torques [N m].
        poses: Number of poses used.
    """

    payload: PayloadConfig
    mass_sd: float
    centre_sd: float
    force_residual: float
    torque_residual: float
    poses: int

    def __str__(self) -> str:
        payload = self.payload
        return (
            f"mass {abs(payload.mass):.4f} kg (+-{self.mass_sd:.2g}), centre {listed(payload.centre, 4)} m "
            f"(+-{self.centre_sd:.2g}), offsets {listed(payload.force_offset)} N and "
            f"{listed(payload.torque_offset, 4)} N m; residual {self.force_residual:.2g} N and "
            f"{self.torque_residual:.2g} N m in {self.poses} poses"
        )


def identify_payload(samples: Sequence[PoseSample], limits: CalibrationParameters) -> Identification:
    """Returns the payload that fits wrenches at rest best.

    Args:
        samples: Mean wrenches, one for each pose.
        limits: Parameters with the largest residuals and the magnitude of gravity.

    Raises:
        UndeterminedError: If the poses are too few or too similar, if the sensor carries no payload, or if no payload
            explains the wrenches.
    """
    if len(samples) < MIN_POSES:
        raise UndeterminedError(f"expected at least {MIN_POSES} poses, got {len(samples)}")
    gravity = np.array([each.gravity for each in samples])
    forces, torques = np.split(np.array([each.wrench for each in samples]), 2, axis=1)
    _check_spread((gravity - gravity.mean(axis=0)) / limits.gravity)
    mass, (mass_sd,), force_offset, force_residual = _fit(-gravity[..., np.newaxis], forces)
    moment, moment_sd, torque_offset, torque_residual = _fit(_cross(gravity), torques)
    for kind, unit, residual, most in (
        ("force", "N", force_residual, limits.max_residual_force),
        ("torque", "N m", torque_residual, limits.max_residual_torque),
    ):
        if residual > most:
            raise UndeterminedError(
                f"{kind}: expected a residual of {most:g} {unit} at most, got {residual:.3g}; was the payload touched, "
                "or is the sensor's frame another one?"
            )
    if abs(mass[0]) < max(MIN_SIGNIFICANCE * mass_sd, MIN_MASS_KG):
        raise UndeterminedError(f"expected a payload, got a mass of {mass[0]:.2g} kg (+-{mass_sd:.2g})")
    centre = moment / mass[0]
    centre_sd = float(np.hypot(moment_sd, centre * mass_sd).max()) / abs(float(mass[0]))
    payload = PayloadConfig(
        mass=float(mass[0]),
        centre=tuple(centre.tolist()),
        force_offset=tuple(force_offset.tolist()),
        torque_offset=tuple(torque_offset.tolist()),
    )
    return Identification(payload, mass_sd, centre_sd, force_residual, torque_residual, len(samples))


def _check_spread(directions: Array) -> None:
    """Raises an UndeterminedError unless gravity's directions vary about two axes.

    Args:
        directions: Directions of gravity in the sensor's axes, minus their mean, shape (N, 3).
    """
    _, second, third = np.linalg.svd(directions, compute_uv=False)
    spread = float(np.hypot(second, third) / np.sqrt(len(directions)))
    if spread < MIN_SPREAD:
        raise UndeterminedError(
            f"the poses are too alike: expected gravity to tilt by {MIN_SPREAD:g} rad about a second axis of the "
            f"sensor, got {spread:.2g}; add poses that tilt it about another axis"
        )


def _fit(factors: Array, values: Array) -> tuple[Array, Array, Array, float]:
    """Fits `values = offset + factors @ x` by least squares.

    Args:
        factors: Shape (N, 3, P).
        values: Shape (N, 3).

    Returns:
        x, shape (P,); the standard deviations of x, shape (P,); the offset, shape (3,); the residual's root mean
        square. The standard deviations are scaled by Student's distribution, so that x plus or minus two standard
        deviations is a 95 % confidence interval.
    """
    count, _, parameters = factors.shape
    A = (factors - factors.mean(axis=0)).reshape(3 * count, parameters)
    b = (values - values.mean(axis=0)).ravel()
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    residual = b - A @ x
    freedom = 3 * count - parameters - 3
    variance = float(residual @ residual) / freedom
    deviations = 0.5 * stdtrit(freedom, 0.975) * np.sqrt(variance * np.linalg.inv(A.T @ A).diagonal())
    return x, deviations, values.mean(axis=0) - factors.mean(axis=0) @ x, float(np.sqrt(np.mean(residual**2)))


def _cross(vectors: Array) -> Array:
    """Returns the cross-product matrices of vectors, shape (N, 3), as an array of shape (N, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
