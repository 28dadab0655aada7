"""Braking trajectories in discrete time: moving joints come to rest within their acceleration and jerk limits.

Time advances in periods of T, and derivatives are backward differences, as in a controller with one command per period:
v_k = (q_k - q_{k-1}) / T, a_k = (v_k - v_{k-1}) / T, j_k = (a_k - a_{k-1}) / T.
"""

import math
from typing import NamedTuple

import numpy as np

GROWTH = 1.15
"""Approximate ratio of each precomputed braking duration to the next shorter one."""
INSIDE = 1.0 - 1e-6
"""Share of the limits that braking uses, so that rounding errors cannot exceed the limits."""
TINY = 1e-300
"""Added to divisors that may be 0."""
MAX_PERIODS = 10_000
"""Largest number of periods that a braking may take."""
FASTEST = 10.0
"""Speed up to which braking is prepared for joints without a velocity limit [rad/s or m/s]."""


class Brake(NamedTuple):
    """Braking of n joints in k periods; all arrays have the shape (k, n).

    Attributes:
        displacement: Displacements from the positions at the start of braking [rad or m].
        velocity: Velocities [rad/s or m/s].
        acceleration: Accelerations [rad/s^2 or m/s^2].
        jerk: Jerks [rad/s^3 or m/s^3].
    """

    displacement: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    def with_joints_of(self, other: "Brake", joints: np.ndarray) -> "Brake":
        """Returns a braking that moves the selected joints as in another braking, and all other joints as in this one.

        Args:
            other: The other braking, which may have another number of periods.
            joints: Mask of the selected joints, n booleans.
        """
        rows = max(len(self.velocity), len(other.velocity))
        return Brake(
            *(
                np.where(joints, _padded(theirs, rows, i == 0), _padded(own, rows, i == 0))
                for i, (own, theirs) in enumerate(zip(self, other))
            )
        )


class BrakingCommands(NamedTuple):
    """Commands to n joints during a braking, one per period; all arrays have the shape (k, n).

    Attributes:
        position: Positions [rad or m].
        velocity: Velocities [rad/s or m/s].
        acceleration: Accelerations [rad/s^2 or m/s^2].
        jerk: Jerks [rad/s^3 or m/s^3].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    @classmethod
    def none(cls, n: int) -> "BrakingCommands":
        """Returns an empty sequence of commands to n joints, with k = 0."""
        return cls(*np.empty((4, 0, n)))

    def after_first(self) -> "BrakingCommands":
        """Returns all commands but the first."""
        return BrakingCommands(*(each[1:] for each in self))

    def brake_from(self, position: np.ndarray) -> Brake:
        """Converts the commands to a braking that starts at n positions [rad or m]."""
        return Brake(self.position - position, *self[1:])


class Braking:
    """Finds braking trajectories of n joints, independently for each joint.

    Each joint comes to rest in N periods with the sequence of jerks whose sum of squares is smallest. This sequence is
    a linear function of the joint's velocity and acceleration at the start. The coefficients are precomputed for
    several numbers N. A braking uses the smallest of these N that keeps the acceleration and jerk limits.

    Args:
        max_velocity: Speed limits, shape (n,) [rad/s or m/s]; inf for a joint without a limit.
        max_acceleration: Acceleration limits, shape (n,) [rad/s^2 or m/s^2]; inf for a joint without a limit.
        max_jerk: Jerk limits, shape (n,) [rad/s^3 or m/s^3]; inf for a joint without a limit.
        period_s: The period T [s].

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
        first, slope = lines[:, 0], lines[:, 1]  # jerk m of length l is (first[l] + slope[l] m) @ (v, a)
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
        """Returns the shortest precomputed braking of each joint that keeps the acceleration and jerk limits.

        Returns None if a joint has no such braking. Velocities and positions during braking are not checked here.

        Args:
            velocity: Velocities at the start, shape (n,) [rad/s or m/s].
            acceleration: Accelerations at the start, shape (n,) [rad/s^2 or m/s^2].
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
        """Returns the displacements until rest [rad or m], and the largest speeds until rest [rad/s or m/s].

        The arguments are the velocities and accelerations of n joints in m states. All arrays have the shape (m, n).
        Results are NaN where no braking keeps the acceleration and jerk limits.
        """
        state = np.array((velocity * self._period_s, acceleration * self._period_s**2))
        fits = self._fits(state)
        shortest = fits.argmax(axis=0)
        end = self._ends[shortest]
        can = np.where(fits.any(axis=0), 1.0, np.nan)
        speed = np.maximum(np.abs(state[0]), np.abs(self._turning_speed(state, shortest))) / self._period_s
        return can * (end[..., 0] * state[0] + end[..., 1] * state[1]), can * speed

    def _turning_speed(self, state: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Returns the velocities at which the accelerations first change sign, shape (m, n) [rad or m per period].

        Args:
            state: Velocities and accelerations, as for `_fits`.
            which: Index of the precomputed braking of each joint in each state, shape (m, n).
        """
        v, a = state
        lines = self._lines[:2, which]  # 2 x m x n x 2
        first, slope = lines[..., 0] * v + lines[..., 1] * a
        p, q = slope / 2.0, first + slope / 2.0  # a + q m + p m^2 = 0
        root = -2.0 * a / (q - np.copysign(1.0, a) * np.sqrt(np.maximum(q * q - 4.0 * p * a, 0.0)) + TINY)
        m = np.floor(np.clip(root, 0.0, self._lengths[which]))
        speed: np.ndarray = v + m * (a + (m + 1.0) * (first / 2.0 + slope * (m + 2.0) / 6.0))
        return speed

    def factors(self, velocity: np.ndarray, acceleration: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns factors f and g, each of shape (count, n), for the displacements of n joints during braking.

        The rows belong to instants that are evenly spaced from the start of braking until all joints rest. At each
        instant, a joint's displacement is f times the initial velocity plus g times the initial acceleration.

        Args:
            velocity: Initial velocities, shape (n,) [rad/s or m/s].
            acceleration: Initial accelerations, shape (n,) [rad/s^2 or m/s^2].
            count: Number of instants.
        """
        state = np.array((velocity * self._period_s, acceleration * self._period_s**2))
        shortest = self._fits(state[:, None])[:, 0].argmax(axis=0)
        rows = np.linspace(0.0, self._lengths[shortest].max(), count).round().astype(int)
        way = np.where(rows[:, None] > 0, self._tables[shortest, 0][:, rows - 1].T, 0.0)  # 2 x count x n
        return way[0] * self._period_s, way[1] * self._period_s**2

    def _fits(self, state: np.ndarray) -> np.ndarray:
        """Returns whether each of the l precomputed brakings keeps the limits, booleans of shape (l, m, n).

        Args:
            state: Velocities (index 0) and accelerations (index 1) of n joints in m states, shape (2, m, n). The unit
                of time is the period.
        """
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
    """Extends k x n values to `rows` rows: with copies of the last row if `repeats` is True, otherwise with zeros."""
    return np.pad(values, ((0, rows - len(values)), (0, 0)), "edge" if repeats and len(values) else "constant")


def _jerk_line(length: int) -> np.ndarray:
    """Returns the matrix M of shape (2, 2) that determines the jerks of a braking in N = `length` periods.

    The jerk in period m = 1 ... N is p + r m, with (p, r) = M @ (v, a) for the velocity v and the acceleration a at
    the start. The unit of time is the period.

    A joint rests after N periods if sum(j_m) = -a and sum((N - m + 1) j_m) = -v - N a. The jerks with the smallest sum
    of squares are a linear combination of the coefficients of both equations, and therefore linear in m.
    """
    n = float(length)
    s1, s2 = n * (n + 1.0) / 2.0, n * (n + 1.0) * (2.0 * n + 1.0) / 6.0
    sums = np.array(((n, s1), (s1, s2)))
    # sum(m j_m) = (N + 1) sum(j_m) - sum((N - m + 1) j_m) = -(N + 1) a + v + N a = v - a
    wanted = np.array(((0.0, -1.0), (1.0, -1.0)))
    return np.linalg.solve(sums, wanted)


def _longest_s(velocity: float, acceleration: float, jerk: float) -> float:
    """Returns an upper bound of the braking duration [s], for states within the limits and speeds up to `FASTEST`.

    The longest braking starts with a velocity v and an acceleration a of the same sign. In continuous time, the
    least-squares braking of duration D then has its largest jerk, (6 v + 4 a D) / D^2, at the start. The largest
    deceleration is at most a / 3 + 1.5 v / D.

    Args:
        velocity: Speed limit [rad/s or m/s].
        acceleration: Acceleration limit [rad/s^2 or m/s^2].
        jerk: Jerk limit [rad/s^3 or m/s^3].
    """
    velocity = min(velocity, FASTEST)
    acceleration = min(acceleration, 2.0 * math.sqrt(velocity * jerk))
    by_acceleration = 2.25 * velocity / acceleration
    by_jerk = (2.0 * acceleration + math.sqrt(4.0 * acceleration * acceleration + 6.0 * velocity * jerk)) / jerk
    return 1.3 * max(by_acceleration, by_jerk if jerk < math.inf else 0.0)
