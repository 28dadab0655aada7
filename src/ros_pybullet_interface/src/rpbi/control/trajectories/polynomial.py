"""Polynomials between two knots of one joint, and the ranges of their values."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Polynomial = tuple[float, float, float, float, float, float]
"""Coefficients of 1, t, ..., t^5. The time t is measured from the segment's origin [s], the value is in rad or m."""

DEGREE = 5
_TO_BERNSTEIN = np.array(
    [[math.comb(i, k) / math.comb(DEGREE, k) if k <= i else 0.0 for k in range(DEGREE + 1)] for i in range(DEGREE + 1)]
)
"""Matrix that converts coefficients of 1, t, ..., t^5 on [0, 1] to coefficients of the Bernstein polynomials."""
_ROOT_TOLERANCE = 1e-9
"""Imaginary part below which a root counts as real, as a share of the interval."""


def line(duration_s: float, p0: float, p1: float) -> Polynomial:
    """Returns the line from position `p0` to `p1` [rad or m] in a duration [s]."""
    return (p0, (p1 - p0) / duration_s, 0.0, 0.0, 0.0, 0.0)


def cubic(duration_s: float, p0: float, p1: float, v0: float, v1: float) -> Polynomial:
    """Returns the cubic Hermite polynomial between positions `p` [rad or m] with velocities `v` [rad/s or m/s]."""
    mean = (p1 - p0) / duration_s
    return (p0, v0, (3.0 * mean - 2.0 * v0 - v1) / duration_s, (v0 + v1 - 2.0 * mean) / duration_s**2, 0.0, 0.0)


def quintic(duration_s: float, p0: float, p1: float, v0: float, v1: float, a0: float, a1: float) -> Polynomial:
    """Returns the quintic Hermite polynomial between positions `p`, with velocities `v` and accelerations `a`.

    Index 0 marks the start, index 1 the end. Units are rad or m, and s.
    """
    t = duration_s
    mean = (p1 - p0) / t
    return (
        p0,
        v0,
        0.5 * a0,
        (10.0 * mean - 6.0 * v0 - 4.0 * v1 - t * (1.5 * a0 - 0.5 * a1)) / t**2,
        (-15.0 * mean + 8.0 * v0 + 7.0 * v1 + t * (1.5 * a0 - a1)) / t**3,
        (6.0 * mean - 3.0 * v0 - 3.0 * v1 - t * (0.5 * a0 - 0.5 * a1)) / t**4,
    )


def derivative(polynomial: Polynomial) -> Polynomial:
    """Returns the derivative of a polynomial with respect to time."""
    _, c1, c2, c3, c4, c5 = polynomial
    return (c1, 2.0 * c2, 3.0 * c3, 4.0 * c4, 5.0 * c5, 0.0)


def value_range(polynomial: Polynomial, duration_s: float) -> tuple[float, float]:
    """Returns the smallest and the largest value of a polynomial between the times 0 and `duration_s` [s]."""
    times_s = [0.0, duration_s]
    if any(polynomial[2:]):  # else it is a line
        # Scales time to [0, 1], so that the roots' accuracy does not depend on the duration.
        scaled = [c * duration_s**k for k, c in enumerate(derivative(polynomial))]
        roots = np.roots(scaled[::-1])
        real = roots.real[np.abs(roots.imag) < _ROOT_TOLERANCE]
        times_s += [float(root) * duration_s for root in real if 0.0 < root < 1.0]
    values = np.polyval(polynomial[::-1], times_s)
    return float(values.min()), float(values.max())


def value_bounds(
    polynomials: Sequence[Polynomial], durations_s: Sequence[float]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Computes bounds of the values of n polynomials quickly; the bounds are not always tight.

    A polynomial stays within the range of its coefficients in the Bernstein basis.

    Args:
        polynomials: The n polynomials.
        durations_s: n durations [s]; the bounds of polynomial i hold for times from 0 to `durations_s[i]`.

    Returns:
        n lower bounds and n upper bounds.
    """
    powers = np.asarray(durations_s)[:, np.newaxis] ** np.arange(DEGREE + 1)
    bernstein = (np.asarray(polynomials) * powers) @ _TO_BERNSTEIN.T
    return bernstein.min(axis=1), bernstein.max(axis=1)
