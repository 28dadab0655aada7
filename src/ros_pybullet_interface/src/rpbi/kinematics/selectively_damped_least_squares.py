"""Selectively damped least squares, calmer near singular postures."""

from __future__ import annotations

import numpy as np

from .chain import Chain
from .target import Target

LARGEST_STEP = np.pi / 4
"""Most that a joint moves in one step [rad or m], as in the paper."""


class SelectivelyDampedLeastSquares:
    """Selectively damped least squares; our own, since PyBullet's ends the process (bullet3 issue 4404).

    After Buss and Kim, Selectively Damped Least Squares for Inverse Kinematics, Journal of Graphics Tools 10(3), 2005.
    The arguments are those of `DampedLeastSquares`.
    """

    def __init__(self, chain: Chain, target: Target, threshold_m: float, damping: np.ndarray) -> None:
        self._chain, self._target, self._threshold_m = chain, target, threshold_m
        self._willingness = 1.0 / np.sqrt(damping)

    def __call__(self, q: np.ndarray, frozen: np.ndarray, iterations: int) -> np.ndarray:
        """See `Step`."""
        willingness = np.where(frozen, 0.0, self._willingness)
        for _ in range(iterations):
            self._chain.set(q)
            error = self._chain.error(self._target)
            if np.abs(error).max() < 0.5 * self._threshold_m:
                break
            jacobian = self._chain.jacobian(q, len(error)) * willingness
            q = q + willingness * _selectively_damped(jacobian, error)
        return q


def _selectively_damped(jacobian: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Returns the m joints' step for an error; each singular direction is damped by what it asks of the joints."""
    lengths = np.linalg.norm(jacobian, axis=0)  # how much the link moves with each joint
    step = np.zeros(jacobian.shape[1])
    for u, sigma, v in zip(*_directions(jacobian)):
        if sigma < 1e-9:
            continue
        moved = np.abs(v) @ lengths / sigma  # what all joints move for this direction, against the 1 that it gains
        largest = min(1.0, 1.0 / moved) * LARGEST_STEP
        step += _clamped(v * (u @ error) / sigma, largest)
    return _clamped(step, LARGEST_STEP)


def _directions(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    u, sigma, vt = np.linalg.svd(jacobian, full_matrices=False)
    return u.T, sigma, vt


def _clamped(step: np.ndarray, largest: float) -> np.ndarray:
    size = np.abs(step).max()
    return step * (largest / size) if size > largest else step
