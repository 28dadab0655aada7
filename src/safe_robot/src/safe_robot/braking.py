"""Braking trajectories in discrete time: how joints that move come to rest within their acceleration and jerk limits.

Time advances in periods of T, and derivatives are backward differences, as in a controller with one command a period:
v_k = (q_k - q_{k-1}) / T, a_k = (v_k - v_{k-1}) / T, j_k = (a_k - a_{k-1}) / T.
"""

import math
from typing import NamedTuple

import numpy as np

GROWTH = 1.15
"""Ratio of each prepared duration of braking to the previous one."""
INSIDE = 1.0 - 1e-6
"""Share of the limits that braking uses, so that rounding does not exceed them."""
TINY = 1e-300
"""Added to divisors that may be 0."""
MAX_PERIODS = 10_000
"""Largest number of periods of a braking; all lengths up to it are prepared."""
FASTEST = 10.0
"""Speed up to which braking is prepared for joints without a velocity limit [rad/s or m/s]."""


class Brake(NamedTuple):
    """Braking of n joints within k periods: each a k x n array.

    Attributes:
        displacement: Displacement from the start [rad or m].
        velocity: [rad/s or m/s].
        acceleration: [rad/s^2 or m/s^2].
        jerk: [rad/s^3 or m/s^3].
    """

    displacement: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    def with_joints_of(self, other: "Brake", joints: np.ndarray) -> "Brake":
        """Returns a braking in which some joints, n booleans, come to rest as in another one, of any length."""
        rows = max(len(self.velocity), len(other.velocity))
        return Brake(
            *(
                np.where(joints, _padded(theirs, rows, i == 0), _padded(own, rows, i == 0))
                for i, (own, theirs) in enumerate(zip(self, other))
            )
        )


class BrakingCommands(NamedTuple):
    """The commands of a braking to n joints, a period apart: each a k x n array.

    Attributes:
        position: [rad or m].
        velocity: [rad/s or m/s].
        acceleration: [rad/s^2 or m/s^2].
        jerk: [rad/s^3 or m/s^3].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    @classmethod
    def none(cls, n: int) -> "BrakingCommands":
        """Returns no commands, k = 0, to n joints."""
        return cls(*np.empty((4, 0, n)))

    def after_first(self) -> "BrakingCommands":
        """Returns all commands but the first."""
        return BrakingCommands(*(each[1:] for each in self))

    def brake_from(self, position: np.ndarray) -> Brake:
        """Returns the braking that these commands describe from n positions [rad or m]."""
        return Brake(self.position - position, *self[1:])


class Braking:
    """Finds braking trajectories of n joints, each joint by itself.

    A joint comes to rest in N periods with the sequence of jerks that has the least sum of squares. It is linear in
    velocity and acceleration, so all lengths N are prepared, and braking is one product of matrices. The length is the
    shortest that keeps the limits.

    Args:
        max_velocity: n largest speeds [rad/s or m/s]; inf where there is none, as below.
        max_acceleration: n largest accelerations [rad/s^2 or m/s^2].
        max_jerk: n largest jerks [rad/s^3 or m/s^3].
        period_s: T [s].

    Raises:
        ValueError: If a braking may take more than `MAX_PERIODS` periods.
    """

    def __init__(
        self, max_velocity: np.ndarray, max_acceleration: np.ndarray, max_jerk: np.ndarray, period_s: float
    ) -> None:
        self._period_s = period_s
        self._max_acceleration, self._max_jerk = INSIDE * max_acceleration, INSIDE * max_jerk
        longest_s = max(map(_longest_s, max_velocity.tolist(), max_acceleration.tolist(), max_jerk.tolist()))
        if not longest_s <= MAX_PERIODS * period_s:
            raise ValueError(
                f"expected limits such that braking takes at most {MAX_PERIODS} periods of period_s, {period_s:g} s;"
                f" got {longest_s:.3g} s"
            )
        lengths = [2]
        while lengths[-1] * period_s < longest_s:
            lengths.append(max(lengths[-1] + 1, round(lengths[-1] * GROWTH)))
        self._lengths = np.array(lengths)
        lines = np.array([_jerk_line(length) for length in lengths])
        first, slope = lines[:, 0], lines[:, 1]  # jerk m of length l is first[l] + slope[l] m, times (v, a)
        last = first + slope * self._lengths[:, None]
        self._lines = np.stack((first, slope, first + slope, last, first + slope + (0.0, 1.0)))
        m = np.arange(1, lengths[-1] + 1)[None, :, None]
        is_within = m <= self._lengths[:, None, None]
        jerk = np.where(is_within, first[:, None] + slope[:, None] * m, 0.0)
        acceleration = np.where(m < self._lengths[:, None, None], np.cumsum(jerk, axis=1) + (0.0, 1.0), 0.0)
        velocity = np.where(m < self._lengths[:, None, None], np.cumsum(acceleration, axis=1) + (1.0, 0.0), 0.0)
        displacement = np.cumsum(velocity, axis=1)
        self._ends = displacement[:, -1]
        tables = np.stack((displacement, velocity / period_s, acceleration / period_s**2, jerk / period_s**3))
        self._tables = np.ascontiguousarray(tables.transpose(1, 0, 2, 3))

    def plan(self, velocity: np.ndarray, acceleration: np.ndarray) -> Brake | None:
        """Returns the braking of n joints from n velocities and n accelerations, None if their limits forbid it.

        Velocities and positions during braking are not checked here.
        """
        state = np.array((velocity * self._period_s, acceleration * self._period_s**2))
        fits = self._fits(state[:, None])[:, 0]
        if not fits.any(axis=0).all():
            return None
        shortest = fits.argmax(axis=0)
        rows = int(self._lengths[shortest].max())
        tables = self._tables[shortest, :, :rows]  # n x 4 x rows x 2
        found = tables[..., 0] * state[0, :, None, None] + tables[..., 1] * state[1, :, None, None]
        return Brake(*found.transpose(1, 2, 0))

    def ends(self, velocity: np.ndarray, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the braking distances of n joints from each of m x n states, and their largest speeds.

        NaN where limits forbid the braking [rad or m, rad/s or m/s].
        """
        state = np.array((velocity * self._period_s, acceleration * self._period_s**2))
        fits = self._fits(state)
        shortest = fits.argmax(axis=0)
        end = self._ends[shortest]
        can = np.where(fits.any(axis=0), 1.0, np.nan)
        speed = np.maximum(np.abs(state[0]), np.abs(self._turning_speed(state, shortest))) / self._period_s
        return can * (end[..., 0] * state[0] + end[..., 1] * state[1]), can * speed

    def _turning_speed(self, state: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Returns the speed where the acceleration first changes its sign, in periods, as `state`."""
        v, a = state
        lines = self._lines[:2, which]  # 2 x m x n x 2
        first, slope = lines[..., 0] * v + lines[..., 1] * a
        p, q = slope / 2.0, first + slope / 2.0  # a + q m + p m^2 = 0
        root = -2.0 * a / (q - np.copysign(1.0, a) * np.sqrt(np.maximum(q * q - 4.0 * p * a, 0.0)) + TINY)
        m = np.floor(np.clip(root, 0.0, self._lengths[which]))
        speed: np.ndarray = v + m * (a + (m + 1.0) * (first / 2.0 + slope * (m + 2.0) / 6.0))
        return speed

    def factors(self, velocity: np.ndarray, acceleration: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns the factors of velocity and of acceleration in the distances of n joints, each count x n.

        Rows are instants, evenly spaced from the beginning until all joints rest.
        """
        state = np.array((velocity * self._period_s, acceleration * self._period_s**2))
        shortest = self._fits(state[:, None])[:, 0].argmax(axis=0)
        rows = np.linspace(0.0, self._lengths[shortest].max(), count).round().astype(int)
        way = np.where(rows[:, None] > 0, self._tables[shortest, 0][:, rows - 1].T, 0.0)  # 2 x count x n
        return way[0] * self._period_s, way[1] * self._period_s**2

    def _fits(self, state: np.ndarray) -> np.ndarray:
        """Returns which of l lengths keep the limits, for each of m x n states; states are 2 x m x n, in periods."""
        products = self._lines.reshape(-1, 2) @ state.reshape(2, -1)
        first, slope, first_jerk, last_jerk, first_acceleration = products.reshape(5, -1, *state.shape[1:])  # l x m x n
        length = self._lengths[:, None, None]
        jerk = np.maximum(np.abs(first_jerk), np.abs(last_jerk))
        slope_or_1 = np.where(slope != 0.0, slope, 1.0)
        turn = np.where(slope != 0.0, -first / slope_or_1 - 0.5, 1.0)  # where the acceleration has its extremum
        turn = np.minimum(np.maximum(turn, 1.0), length)
        peak = state[1] + turn * (first + slope * (turn + 1.0) / 2.0)
        peak = np.maximum(np.abs(peak), np.abs(first_acceleration))
        is_within = jerk <= self._max_jerk * self._period_s**3
        is_within &= peak <= self._max_acceleration * self._period_s**2
        return is_within


def _padded(values: np.ndarray, rows: int, repeats: bool) -> np.ndarray:
    """Returns k x n values with rows after them, which repeat the last one, if there is one, or are 0."""
    return np.pad(values, ((0, rows - len(values)), (0, 0)), "edge" if repeats and len(values) else "constant")


def _jerk_line(length: int) -> np.ndarray:
    """Returns p and r, each of velocity and acceleration, such that jerk m = 1 ... N of a braking is p + r m.

    With T = 1, rest after N periods is sum(j_m) = -a and sum((N - m + 1) j_m) = -v - N a. The least sum of squares is
    where j is a sum of both rows, a line in m.
    """
    n = float(length)
    s1, s2 = n * (n + 1.0) / 2.0, n * (n + 1.0) * (2.0 * n + 1.0) / 6.0
    sums = np.array(((n, s1), (s1, s2)))
    # sum(m j_m) = (N + 1) sum(j_m) - sum((N - m + 1) j_m) = -(N + 1) a + v + N a = v - a
    wanted = np.array(((0.0, -1.0), (1.0, -1.0)))
    return np.linalg.solve(sums, wanted)


def _longest_s(velocity: float, acceleration: float, jerk: float) -> float:
    """Returns an upper bound of the duration of braking from any state within limits [s].

    In continuous time the least squares have jerk (6 v + 4 a D) / D^2 at first, and at worst a third of the present
    acceleration and 1.5 v / D the other way.
    """
    velocity = min(velocity, FASTEST)
    acceleration = min(acceleration, 2.0 * math.sqrt(velocity * jerk))
    by_acceleration = 2.25 * velocity / acceleration
    by_jerk = (2.0 * acceleration + math.sqrt(4.0 * acceleration * acceleration + 6.0 * velocity * jerk)) / jerk
    return 1.3 * max(by_acceleration, by_jerk if jerk < math.inf else 0.0)
