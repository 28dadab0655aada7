"""Dynamic movement primitives as in the original `dmp` package, for old clients; one primitive for each dimension.

The forcing term is stored as samples at fractions of the duration, and interpolated linearly. New code should use
`PRIMITIVES`, whose motions are smooth, end on time, and may include orientations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from custom_ros_tools.transforms import Array

from .basis import DECAY, GaussianBasis, fitted
from .demonstration import check_increasing, checked_array
from .errors import DemonstrationError, PlanError

MIN_SAMPLES = 3
"""Smallest number of samples in a demonstration."""
LONGEST_S = 1000.0
"""Duration after which a plan ends, even if the goal is not reached [s]."""
MAX_STEPS = 1_000_000
"""Number of integration steps after which a plan ends."""
MIN_WEIGHTS = 2


@dataclass(frozen=True)
class ReleaseDMP:
    """A primitive of one dimension.

    Attributes:
        k_gain: Stiffness for a duration of 1 s [1/s^2].
        d_gain: Damping for a duration of 1 s [1/s].
        weights: Weights of Gaussians that approximate the forcing term; used if `f_domain` is empty.
        f_domain: Increasing times of the forcing term's samples, as fractions of the duration.
        f_targets: Values of the quotient forcing term / phase at the times `f_domain`.
    """

    k_gain: float
    d_gain: float
    weights: tuple[float, ...]
    f_domain: tuple[float, ...]
    f_targets: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("k_gain", "d_gain"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise PlanError(name, "a finite number above 0", f"{getattr(self, name)}")
        for name in ("weights", "f_domain", "f_targets"):
            if not np.isfinite(getattr(self, name)).all():
                raise PlanError(name, "finite numbers", "others")
        if len(self.f_domain) != len(self.f_targets):
            raise PlanError("f_targets", f"{len(self.f_domain)} numbers, as many as f_domain", f"{len(self.f_targets)}")
        if not self.f_domain and len(self.weights) < MIN_WEIGHTS:
            raise PlanError("f_domain", "samples of the forcing term, or weights", "neither")
        if (np.diff(self.f_domain) <= 0.0).any():
            raise PlanError("f_domain", "increasing numbers", "one that is not larger than the one before")

    def forcing(self, share: float) -> float:
        """Returns the forcing term divided by the phase, at a time given as a fraction of the duration."""
        if self.f_domain:
            return float(np.interp(share, self.f_domain, self.f_targets))
        values = GaussianBasis.of(len(self.weights)).values(np.array(share))
        return float(values @ self.weights / math.exp(-DECAY * share))


class ReleasePlan(NamedTuple):
    """A planned motion of n dimensions.

    Attributes:
        times: m times [s]; the first is one time step after the start.
        positions: m x n positions.
        velocities: m x n velocities, per second.
        is_at_goal: Whether the motion ends at the goal.
    """

    times: Array
    positions: Array
    velocities: Array
    is_at_goal: bool


def learn(
    times: ArrayLike, positions: ArrayLike, k_gains: ArrayLike, d_gains: ArrayLike, num_bases: int
) -> tuple[list[ReleaseDMP], float]:
    """Learns a primitive for each of n dimensions from one demonstration.

    Args:
        times: m increasing times, not negative [s].
        positions: m x n positions.
        k_gains: Stiffness of each of the n primitives.
        d_gains: Damping of each of the n primitives.
        num_bases: Number of Gaussians to fit; below 2, no weights are computed.

    Returns:
        The n primitives, and the duration tau [s], which is the last time.

    Raises:
        DemonstrationError: If the demonstration has too few samples, times do not increase or sizes differ.
        PlanError: If gains are invalid.
    """
    t, x = checked_array(times, "times", 1), checked_array(positions, "positions", 2)
    if len(t) != len(x):
        raise DemonstrationError("times", f"{len(x)} numbers, as many as points", f"{len(t)}")
    check_increasing(t, MIN_SAMPLES)
    if t[0] < 0.0:
        raise DemonstrationError("times", "times from 0 on", f"{t[0]:g} s")
    tau, n = float(t[-1]), x.shape[1]
    k, d = _numbers(k_gains, n, "k_gains"), _numbers(d_gains, n, "d_gains")
    if not (k > 0.0).all() or not (d > 0.0).all():
        raise PlanError("k_gains and d_gains", "numbers above 0", f"{k.tolist()} and {d.tolist()}")
    v = np.gradient(x, t, axis=0)
    a = np.gradient(v, t, axis=0)
    phase = np.exp(-DECAY * t / tau)[:, None]
    goal, start = x[-1], x[0]
    targets = ((tau**2 * a + d * tau * v) / k - (goal - x) + (goal - start) * phase) / phase
    if num_bases < 0:
        raise PlanError("num_bases", "at least 0", f"{num_bases}")
    weights = np.zeros((n, 0))
    if num_bases >= MIN_WEIGHTS:
        weights = fitted(GaussianBasis.of(num_bases).values(t / tau), targets * phase)
    domain = tuple((t / tau).tolist())
    columns = zip(k.tolist(), d.tolist(), weights.tolist(), targets.T.tolist())
    return [ReleaseDMP(ki, di, tuple(wi), domain, tuple(fi)) for ki, di, wi, fi in columns], tau


def plan(
    primitives: Sequence[ReleaseDMP],
    x_0: ArrayLike,
    x_dot_0: ArrayLike,
    t_0: float,
    goal: ArrayLike,
    goal_thresh: ArrayLike,
    seg_length: float,
    tau: float,
    dt: float,
    integrate_iter: int,
) -> ReleasePlan:
    """Plans a motion by integration with Euler's method.

    Without `seg_length`, the plan ends when the time tau has passed and the goal is reached, but after 1000 s at the
    latest.

    Args:
        primitives: One primitive for each of n dimensions.
        x_0: n start positions.
        x_dot_0: n start velocities, per second.
        t_0: Time within the primitives' duration at which the motion starts [s].
        goal: n goal positions.
        goal_thresh: n largest distances from the goal that count as reached. Dimensions with a value of 0 or less are
            ignored.
        seg_length: Duration of the plan [s]. With 0 or less, the plan ends when the goal is reached.
        tau: Duration of the primitives [s].
        dt: Time between two points [s].
        integrate_iter: Number of integration steps between two points.

    Raises:
        PlanError: If an argument is invalid.
    """
    n = len(primitives)
    if not n:
        raise PlanError("dmp_list", "primitives; call set_active_dmp first", "none")
    x, velocity = _numbers(x_0, n, "x_0"), _numbers(x_dot_0, n, "x_dot_0")
    end, near = _numbers(goal, n, "goal"), _numbers(goal_thresh, n, "goal_thresh")
    for name, value in (("tau", tau), ("dt", dt)):
        if not 0.0 < value < math.inf:
            raise PlanError(name, "a finite time above 0 s", f"{value}")
    for name, value in (("t_0", t_0), ("seg_length", seg_length)):
        if not math.isfinite(value):
            raise PlanError(name, "a finite time", f"{value}")
    if integrate_iter < 1:
        raise PlanError("integrate_iter", "at least 1", f"{integrate_iter}")
    shortest_s = min(seg_length if seg_length > 0.0 else tau - t_0, LONGEST_S)
    if shortest_s / dt * integrate_iter > MAX_STEPS:
        least = shortest_s * integrate_iter / MAX_STEPS
        raise PlanError("dt", f"at least {least:.3g} s with {integrate_iter} steps each", f"{dt}")
    longest_s = min(seg_length if seg_length > 0.0 else LONGEST_S, LONGEST_S, MAX_STEPS * dt / integrate_iter)
    k, d = np.array([each.k_gain for each in primitives]), np.array([each.d_gain for each in primitives])
    start, v, step = x.copy(), velocity * tau, dt / integrate_iter
    times, positions, velocities = [], [], []
    count, is_at_goal, is_over = 0, False, False
    while not is_over:
        for index in range(integrate_iter):
            time_s = t_0 + count * dt + index * step
            phase = math.exp(-DECAY * time_s / tau)
            f = np.zeros(n) if time_s >= tau else phase * np.array([each.forcing(time_s / tau) for each in primitives])
            v_dot = (k * ((end - x) - (end - start) * phase + f) - d * v) / tau
            x, v = x + v / tau * step, v + v_dot * step
        count += 1
        times.append(count * dt)
        positions.append(x)
        velocities.append(v / tau)
        is_at_goal = bool(((np.abs(x - end) <= near) | (near <= 0.0)).all())
        has_arrived = seg_length <= 0.0 and t_0 + times[-1] >= tau * (1.0 - 1e-12) and is_at_goal
        is_over = has_arrived or times[-1] >= longest_s * (1.0 - 1e-12)
    if not np.isfinite(positions[-1]).all():
        raise PlanError("dt", "a step with which the motion stays finite", f"{step:g} s; use more integrate_iter")
    return ReleasePlan(np.array(times), np.array(positions), np.array(velocities), is_at_goal)


def _numbers(values: ArrayLike, count: int, name: str) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise PlanError(name, f"{count} finite numbers, one for each dimension", f"{array.tolist()}")
    return array
