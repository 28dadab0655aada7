"""Stops a motion along its own path, which was found to be free."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.transforms import Array

STEP_S = 0.02
"""Time between two samples of the braking [s]."""
SHORTEST_S = 0.2
"""Least duration of the braking [s]."""
PEAK = 1.875
"""Largest slope of the minimum-jerk polynomial."""


class SampledMotion(NamedTuple):
    """A motion of n joints, as k samples.

    Attributes:
        times: Times since the start [s], shape (k,).
        positions: Positions [rad or m], shape (k, n).
        velocities: Velocities [rad/s or m/s], shape (k, n).
        accelerations: Accelerations [rad/s^2 or m/s^2], shape (k, n).
    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array

    @property
    def duration_s(self) -> float:
        """Duration of the motion [s]."""
        return float(self.times[-1])


def braked(trajectory: SampledMotion, from_s: float, acceleration: float) -> SampledMotion:
    """Returns the motion that follows a trajectory from a time on and slows down to rest.

    The speed along the path decreases from 1 to 0 as a minimum-jerk polynomial of the time (T. Flash, N. Hogan,
    J. Neuroscience 5(7), 1985), so the robot stays on the path.

    Args:
        trajectory: The trajectory.
        from_s: Time of the trajectory at which the braking begins [s].
        acceleration: Largest acceleration that the braking adds to each joint [rad/s^2 or m/s^2].

    Raises:
        ValueError: If the acceleration is not positive.
    """
    if not acceleration > 0.0:
        raise ValueError(f"acceleration: expected a positive number, got {acceleration:g}")
    times = np.asarray(trajectory.times)
    end_s = float(times[-1])
    speed = np.abs(_sampled(times, trajectory.velocities, np.append(times[times > from_s], [from_s]))).max()
    duration_s = max(SHORTEST_S, PEAK * float(speed) / acceleration)
    at_s = np.linspace(0.0, duration_s, max(int(np.ceil(duration_s / STEP_S)), 2) + 1)
    share = at_s / duration_s
    rate = 1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    slowing = -30.0 * share**2 * (1.0 - share) ** 2 / duration_s
    path_s = np.minimum(from_s + at_s - duration_s * share**4 * (2.5 - 3.0 * share + share**2), end_s)
    positions, velocities, accelerations = (
        _sampled(times, values, path_s)
        for values in (trajectory.positions, trajectory.velocities, trajectory.accelerations)
    )
    slowed: Array = accelerations * np.square(rate)[:, None] + velocities * slowing[:, None]
    return SampledMotion(at_s, positions, velocities * rate[:, None], slowed)


def _sampled(times: Array, values: Any, at_s: Array) -> Array:
    """Interpolates the columns of values of shape (k, n) at some times [s]."""
    return np.column_stack([np.interp(at_s, times, column) for column in np.asarray(values).T])
