"""Interpolates series of points. The functions have the names and arguments of this project's original release.

The functions `interpolate_...` return sample times [s] and samples. Samples are `1/sample_freq` [s] apart, starting at
the first time in `time_seq`, which need not be 0. The last sample is at the last time in `time_seq`; the step before
the last sample may be shorter.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, interp1d
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from rpbi.control.trajectories.polynomial import derivative, quintic

Array = NDArray[np.float64]
Samples = tuple[Array, Array]
ROUNDING = 1e-9
"""Longest last step that is merged into the step before, as a share of a step."""


def sample_times(start_s: float, end_s: float, step_s: float) -> Array:
    """Returns times from start to end, both included, in equal steps [s]. The last step may be shorter.

    Raises:
        ValueError: If the step is not positive.
    """
    if not step_s > 0.0:
        raise ValueError(f"expected a step of more than 0 s, got {step_s:g} s")
    count = max(0, int(np.ceil((end_s - start_s) / step_s - ROUNDING)))
    return np.append(start_s + step_s * np.arange(count), end_s)


def interpolate_linearly_quaternions(time_seq: ArrayLike, quat_seq: ArrayLike, sample_freq: float = 100) -> Samples:
    """Interpolates K quaternions x, y, z, w, shape (4, K), with constant angular velocity between neighbours.

    The samples have the shape (N, 4).
    """
    return _rotations(Slerp, time_seq, quat_seq, sample_freq)


def interpolate_cubic_quaternions(time_seq: ArrayLike, quat_seq: ArrayLike, sample_freq: float = 100) -> Samples:
    """Interpolates K quaternions x, y, z, w, shape (4, K), with continuous angular acceleration.

    The samples have the shape (N, 4).
    """
    return _rotations(RotationSpline, time_seq, quat_seq, sample_freq)


def interpolate_cubic_hermite_spline(
    time_seq: ArrayLike,
    pos_seq: ArrayLike,
    dpos_seq: ArrayLike,
    sample_freq: float = 100,
    plot_flag: bool = False,
    plot_title: str = "None",
) -> Samples:
    """Interpolates K values with K derivatives, both of shape (K,) or (K, S), by cubic polynomials."""
    curve = CubicHermiteSpline(time_seq, pos_seq, dpos_seq)
    return _sampled(curve, time_seq, pos_seq, sample_freq, plot_flag, plot_title)


def interpolate_poly_fit(
    time_seq: ArrayLike,
    pos_seq: ArrayLike,
    poly_order: int = 5,
    sample_freq: float = 100,
    plot_flag: bool = False,
    plot_title: str = "None",
) -> Samples:
    """Fits a polynomial of order `poly_order` to K values by least squares, and samples the polynomial."""
    curve = np.poly1d(np.polyfit(np.asarray(time_seq, float), np.asarray(pos_seq, float), poly_order))
    return _sampled(curve, time_seq, pos_seq, sample_freq, plot_flag, plot_title)


def interpolate_interp1d(
    time_seq: ArrayLike,
    pos_seq: ArrayLike,
    kind: str = "linear",
    sample_freq: float = 100,
    plot_flag: bool = False,
    plot_title: str = "None",
) -> Samples:
    """Interpolates K values by `scipy.interpolate.interp1d` of a `kind` such as linear, nearest, quadratic or cubic."""
    curve = interp1d(time_seq, pos_seq, kind=kind)
    return _sampled(curve, time_seq, pos_seq, sample_freq, plot_flag, plot_title)


def interpolate_cubic_spline(
    time_seq: ArrayLike,
    pos_seq: ArrayLike,
    sample_freq: float = 100,
    plot_flag: bool = False,
    plot_title: str = "None",
) -> Samples:
    """Interpolates K values, shape (K,) or (K, S), by a cubic spline with continuous accelerations."""
    return _sampled(CubicSpline(time_seq, pos_seq), time_seq, pos_seq, sample_freq, plot_flag, plot_title)


def interpolate_cubic_hermite_spline_source_code(
    time_seq: ArrayLike,
    pos_seq: ArrayLike,
    derpos_seq: ArrayLike,
    sample_freq: float = 100,
    plot_flag: bool = False,
    plot_title: str = "PositionVsTime",
) -> Samples:
    """Interpolates K values with K derivatives, both of shape (K,), by a `TCubicHermiteSpline`."""
    spline = TCubicHermiteSpline()
    spline.Initialize(list(zip(*(np.asarray(each).tolist() for each in (time_seq, pos_seq, derpos_seq)))), 0)
    return _sampled(
        np.vectorize(spline.Evaluate, otypes=[float]), time_seq, pos_seq, sample_freq, plot_flag, plot_title
    )


def plot_interpol_results(
    intertime_seq: ArrayLike, interpos_seq: ArrayLike, time_seq: ArrayLike, pos_seq: ArrayLike, plot_title: str
) -> None:
    """Opens a window that plots the samples as a line and the given values as points."""
    import matplotlib.pyplot as plt  # only plots need it

    plt.figure()
    plt.plot(intertime_seq, interpos_seq)
    plt.plot(time_seq, pos_seq, "*")
    plt.title(plot_title)
    plt.show()


def poly5(
    x_seq: Sequence[float], v_seq: Sequence[float], a_seq: Sequence[float], t_seq: Sequence[float], tc: float
) -> tuple[float, float, float]:
    """Returns position, velocity and acceleration at time `tc` [s] on the quintic polynomial between two states.

    Args:
        x_seq: Position at the start and at the end.
        v_seq: Velocity at the start and at the end.
        a_seq: Acceleration at the start and at the end.
        t_seq: Time of the start and of the end [s].
    """
    curve = quintic(t_seq[1] - t_seq[0], *x_seq, *v_seq, *a_seq)
    values = (
        np.polyval(each[::-1], tc - t_seq[0]) for each in (curve, derivative(curve), derivative(derivative(curve)))
    )
    position, velocity, acceleration = map(float, values)
    return position, velocity, acceleration


class TCubicHermiteSpline:
    """Cubic spline through key points. The slope at a key point is averaged from the given derivatives nearby."""

    FINITE_DIFF, CARDINAL = 0, 1
    ZERO, GRAD, CYCLIC = 0, 1, 2

    def __init__(self) -> None:
        self._times_s: list[float] = []
        self._curve: CubicHermiteSpline | None = None

    def Initialize(  # noqa: N802 (the release's name)
        self,
        data: Sequence[Sequence[float]],
        tan_method: int = CARDINAL,
        end_tan: int = GRAD,
        c: float = 0.0,
        m: float = 1.0,
    ) -> None:
        """Sets the key points.

        Args:
            data: K tuples of time [s], value and derivative, one for each key point, in any order.
            tan_method: Slope at an inner point. FINITE_DIFF: weighted mean of the derivatives at the point (weight 2)
                and at both neighbours (weight 1). CARDINAL: mean of the derivatives at both neighbours, times 1 - `c`.
            end_tan: Slope at both ends. ZERO: 0. GRAD: mean of the derivatives at the end and its neighbour, times
                `m`. CYCLIC: slope of an inner point, as if both ends were the same point.
            c: Tension for CARDINAL, see `tan_method`.
            m: Factor for GRAD, see `end_tan`.
        """
        times_s, values, given = (list(column) for column in zip(*sorted(map(tuple, data))))
        d = np.asarray(given, dtype=float)
        slopes = d.copy()
        weight = 0.25 if tan_method == self.FINITE_DIFF else 0.5 * (1.0 - c)
        own = 0.5 if tan_method == self.FINITE_DIFF else 0.0
        slopes[1:-1] = weight * (d[:-2] + d[2:]) + own * d[1:-1]
        if end_tan == self.ZERO:
            slopes[[0, -1]] = 0.0
        elif end_tan == self.GRAD:
            slopes[0], slopes[-1] = 0.5 * m * (d[0] + d[1]), 0.5 * m * (d[-2] + d[-1])
        else:
            slopes[[0, -1]] = weight * (d[1] + d[-2]) + 0.5 * own * (d[0] + d[-1])
        self._times_s, self._curve = times_s, CubicHermiteSpline(times_s, values, slopes)

    def FindIdx(self, t: float, idx_prev: int = 0) -> int:  # noqa: N802
        """Returns the index of the last key point up to a time [s]; -1 before the first key point."""
        return bisect_right(self._times_s, t) - 1

    def Evaluate(self, t: float) -> float:  # noqa: N802
        """Returns the value at a time [s]. Before the first and after the last key point, the value is constant."""
        if self._curve is None:
            raise ValueError("expected key points by Initialize, got none")
        return float(self._curve(np.clip(t, self._times_s[0], self._times_s[-1])))

    def PhaseInfo(self, t: float) -> tuple[float, float]:  # noqa: N802
        """Returns the number of complete periods before a time [s], and the corresponding time in the first period."""
        start, end = self._times_s[0], self._times_s[-1]
        periods, rest = divmod(t - start, end - start)
        return periods, start + rest

    def EvaluateC(self, t: float, pi: tuple[float, float] | None = None) -> float:  # noqa: N802
        """Returns the value of the periodically repeated curve at a time [s].

        Each repetition is shifted so that it begins at the last value of the previous period.

        Args:
            t: Time [s].
            pi: Result of `PhaseInfo(t)`; None to compute the result.
        """
        periods, within = self.PhaseInfo(t) if pi is None else pi
        first, last = self.Evaluate(self._times_s[0]), self.Evaluate(self._times_s[-1])
        return self.Evaluate(within) + periods * (last - first)


def _sampled(
    curve: Callable[[Array], Array],
    time_seq: ArrayLike,
    pos_seq: ArrayLike,
    sample_freq: float,
    plot_flag: bool,
    plot_title: str,
) -> Samples:
    times = np.asarray(time_seq, dtype=float)
    at = sample_times(times[0], times[-1], 1.0 / sample_freq)
    samples = np.asarray(curve(at))
    if plot_flag:
        plot_interpol_results(at, samples, time_seq, pos_seq, plot_title)
    return at, samples


def _rotations(
    spline: Callable[[Array, Rotation], Callable[[Array], Rotation]],
    time_seq: ArrayLike,
    quat_seq: ArrayLike,
    sample_freq: float,
) -> Samples:
    times = np.asarray(time_seq, dtype=float)
    at = sample_times(times[0], times[-1], 1.0 / sample_freq)
    return at, spline(times, Rotation.from_quat(np.asarray(quat_seq).T))(at).as_quat()
