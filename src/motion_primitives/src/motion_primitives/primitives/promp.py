"""Probabilistic movement primitives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, ListOf, Positive, Seconds
from custom_ros_tools.transforms import Array
from motion_primitives.basis import TimeBasis, fitted
from motion_primitives.demonstration import Demonstration
from motion_primitives.dynamics import TOLERANCE, TOLERANCE_RAD, Execution, PathExecution, SpringDamper
from motion_primitives.errors import DemonstrationError, PlanError
from motion_primitives.primitive import Primitive, PrimitiveConfig, ViaPoint, check_shape
from motion_primitives.space import Space, angular_velocity

MAX_ANGLE_RAD = 0.95 * math.pi
"""Largest rotation from the mean orientation to a demonstrated orientation [rad]. Near pi, its axis is ambiguous."""
PRIOR_SHARE = 0.1
"""Standard deviation of the prior, as a fraction of the motion's extent."""
PRIOR_LENGTH = 0.2
"""Correlation length of the prior over time, as a fraction of the duration."""
MIN_EXTENT = 0.01
"""Smallest extent of a motion that is used; smaller extents are replaced by this value [m or rad]."""
SAMPLES_OF_MEAN = 50
"""Approximate number of samples from each demonstration that are used to compute the mean orientation."""
END_WEIGHT = 100.0
"""Factor of the errors at the first and last sample in a fit, so that the demonstrated start and goal are kept."""
EXACT_STD = 1e-6
"""Standard deviation of points that are known exactly, such as start and goal [m or rad]."""
LAST_CHANGE = 0.9
"""Time up to which the goal can be changed, as a fraction of the duration."""
LOOKS = np.linspace(0.0, 1.0, 201)
"""Times at which a motion is checked, as fractions of the duration."""
MISSED_STDS = 3.0
"""A known point counts as missed if its error exceeds this multiple of its standard deviation, plus the tolerance."""
MAX_TURN_RAD = 2.0 * math.pi
"""Largest angle between a planned orientation and the mean orientation [rad]: one whole turn."""


class ProMPConfig(PrimitiveConfig):
    """Options of a probabilistic movement primitive."""

    bases: int = Field(20, ge=4, le=200, description="Number of basis functions of each signal.")
    prior: Positive = Field(
        1.0,
        description="Weight of the prior for smooth deviations from the mean, as an equivalent number of "
        "demonstrations. Where demonstrations do not differ, larger values lead to smoother motions through new "
        "points.",
    )
    reach: Positive = Field(
        2.0,
        description="Largest distance of a motion from the demonstrated positions, as a multiple of the largest "
        "extent of these positions. A motion that exceeds this distance is refused.",
    )


class LearnedProMP(ConfigModel):
    """Learned data of a probabilistic movement primitive."""

    origin: ListOf[float] = Field(
        description="Reference point of the signals: the orientation is the demonstrations' mean, and all positions "
        "are 0."
    )
    duration_s: Seconds = Field(description="Mean duration of the demonstrations.")
    weights: ListOf[ListOf[ListOf[float]]] = Field(
        description="Weights of the basis functions: for each demonstration, one row for each signal."
    )


class WeightDistribution(NamedTuple):
    """Normal distribution of the weights of d signals with k basis functions each.

    Attributes:
        mean: Mean of the weights, shape (d * k,): k weights of the first signal, k weights of the second, and so on.
        covariance: Covariance of the weights, shape (d * k, d * k).
    """

    mean: Array
    covariance: Array

    def given(self, rows: Array, values: Array, variances: Array) -> WeightDistribution:
        """Returns the distribution after conditioning on c observations (Paraschos 2013, equation 5).

        The observations are linear functions of the weights.

        Args:
            rows: Coefficients of the linear functions, shape (c, d * k).
            values: Observed values, shape (c,).
            variances: Variances of the observations, shape (c,).
        """
        across = self.covariance @ rows.T
        gain = np.linalg.solve(rows @ across + np.diag(variances), across.T).T
        mean = self.mean + gain @ (values - rows @ self.mean)
        return WeightDistribution(mean, self.covariance - gain @ across.T)


class Known(NamedTuple):
    """A known point of a motion, or a known time derivative of a point, on which a distribution is conditioned.

    Attributes:
        subject: Name for error messages.
        progress: Time at which the point is known, as a fraction of the duration.
        values: Coordinates of the point, or their time derivatives for a duration of 1 s, shape (dof,).
        std: Standard deviation of each value [m or rad].
        is_rate: Whether `values` are time derivatives.
    """

    subject: str
    progress: float
    values: Array
    std: float = EXACT_STD
    is_rate: bool = False


class MeanPath:
    """The path of a ProMP: the mean motion of the ProMP's distribution, conditioned on known points and on the goal.

    Args:
        primitive: The primitive.
        known: Known points and rates, in addition to the goal.
        duration_s: Duration of the motion [s].
        goal: Last point; None if `known` includes the last point.

    Raises:
        PlanError: If the mean motion misses a known point, or is too far from the demonstrations.
    """

    def __init__(self, primitive: ProMP, known: Sequence[Known], duration_s: float, goal: Array | None) -> None:
        self._primitive, self._known, self.end_s = primitive, list(known), duration_s
        self._distribution = self._to(self._known, goal)

    def _to(self, known: Sequence[Known], goal: Array | None, progress: float = 0.0) -> WeightDistribution:
        """Conditions the distribution on known points and a goal, and checks the new mean motion from `progress` on."""
        primitive = self._primitive
        to_goal = [] if goal is None else [Known("goal", 1.0, primitive.coordinates(goal))]
        distribution = primitive.given(primitive.distribution, [*known, *to_goal])
        primitive.check(distribution, [*known, *to_goal], self.end_s, progress)
        return distribution

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Returns the point and the velocity, shape (dof,), at a time since the start [s]."""
        point, velocity = self._primitive.mean_at(self._distribution, time_s / self.end_s)
        return point, velocity / self.end_s

    def set_goal(self, goal: Array, time_s: float) -> None:
        """Changes the goal by conditioning the distribution on the mean motion's current state and on the new goal.

        Raises:
            PlanError: If more than 90 % of the duration have passed, or the new mean motion is invalid.
        """
        primitive, progress = self._primitive, time_s / self.end_s
        if progress > LAST_CHANGE:
            got = f"one after {min(progress, 1.0):.0%}"
            raise PlanError("goal", f"a change before {LAST_CHANGE:.0%} of the duration", got)
        mean, now = self._distribution.mean, []
        for is_rate in (False, True):
            values = primitive.rows(progress, is_rate) @ mean
            now.append(Known("present motion", progress, values, is_rate=is_rate))
        known = [*self._known, *now]
        self._distribution = self._to(known, goal, progress)
        self._known = known


class ProMP(Primitive):
    """A probabilistic movement primitive, which adapts the demonstrations' mean motion to start, goal and via-points.

    Follows Paraschos 2013. Orientations are represented as rotation vectors from the demonstrations' mean orientation.
    """

    Config = ProMPConfig
    Learned = LearnedProMP

    def _learn(self, space: Space, demonstrations: Sequence[Demonstration]) -> None:
        n = len(space.names)
        samples = [each.points[:: max(len(each.points) // SAMPLES_OF_MEAN, 1)] for each in demonstrations]
        origin = space.mean(list(np.vstack(samples)))
        origin[:n] = 0.0
        basis, weights = TimeBasis.of(self.config.bases), []
        for index, each in enumerate(demonstrations):
            path = np.array([space.minus(point, origin) for point in each.points])
            largest = float(np.linalg.norm(path[:, n:], axis=1).max())
            if largest > MAX_ANGLE_RAD:
                expected = f"at most {MAX_ANGLE_RAD:.3g} rad from their mean"
                raise DemonstrationError("orientations", expected, f"{largest:.3g} rad in [{index}]")
            values = basis.values(each.times / each.duration_s)
            values, path = (np.vstack([part, END_WEIGHT * part[[0, -1]]]) for part in (values, path))
            weights.append(fitted(values, path, roughness=basis.roughness))
        duration_s = float(np.mean([each.duration_s for each in demonstrations]))
        self._set(space, origin, duration_s, np.array(weights))

    def _set(self, space: Space, origin: Array, duration_s: float, weights: Array) -> None:
        """Sets the learned data, and computes the distribution of the weights.

        Args:
            space: Space of the points.
            origin: Point with the demonstrations' mean orientation, and positions 0.
            duration_s: Mean duration of the demonstrations [s].
            weights: Weights of N demonstrations with k basis functions, shape (N, dof, k).
        """
        self._origin, self._duration_s, self._weights = origin, duration_s, weights
        self._basis = TimeBasis.of(self.config.bases)
        self._dof = space.dof
        shown = weights @ self._basis.values(LOOKS).T
        self._least, self._most = shown.min(axis=(0, 2)), shown.max(axis=(0, 2))
        count, rows = len(weights), weights.reshape(len(weights), -1)
        mean = rows.mean(axis=0)
        spread = (rows - mean).T @ (rows - mean)
        centers = self._basis.centers
        kernel = np.exp(-0.5 * ((centers[:, None] - centers) / PRIOR_LENGTH) ** 2)
        kernel += 1e-6 * np.eye(len(centers))
        prior = self.config.prior
        scales = np.diag(self._prior_stds(space, mean.reshape(space.dof, -1)) ** 2)
        self.distribution = WeightDistribution(mean, (spread + prior * np.kron(scales, kernel)) / (count + prior))

    def _prior_stds(self, space: Space, weights: Array) -> Array:
        """Returns the prior's standard deviation for each signal, shape (dof,).

        All positions share one value, and all components of the rotation vector share another value.
        """
        extents, n = np.ptp(weights, axis=1), len(space.names)
        parts = (part for part in (extents[:n], extents[n:]) if len(part))
        return np.concatenate([np.full(len(part), PRIOR_SHARE * max(part.max(), MIN_EXTENT)) for part in parts])

    def _begin(
        self,
        start: Array | None,
        goal: Array | None,
        duration_s: float | None,
        via_points: Sequence[ViaPoint],
        velocity: Array,
    ) -> Execution:
        duration = self._duration_s if duration_s is None else duration_s
        if start is None and velocity.any():
            raise PlanError("velocity", "a start with it", "none")
        known = [
            Known(f"via_points[{index}]", each.progress, self.coordinates(each.point), each.std)
            for index, each in enumerate(via_points)
        ]
        ends = {each.progress for each in via_points}
        shown_start, shown_goal = (self.mean_at(self.distribution, progress)[0] for progress in (0.0, 1.0))
        if start is None and 0.0 not in ends:
            start = shown_start
        if goal is None and 1.0 not in ends:
            goal = shown_goal
        rate = velocity if start is None else duration * self.space.shift_rate(self.coordinates(start), velocity)
        known.append(Known("velocity", 0.0, rate, is_rate=True))
        known.append(Known("velocity", 1.0, np.zeros(self._dof), is_rate=True))
        if start is not None:
            known.append(Known("start", 0.0, self.coordinates(start)))
        spring, rest = SpringDamper(self.config.alpha, duration), np.zeros(self._dof)
        path = MeanPath(self, known, duration, goal)
        return PathExecution(self.space, spring, path, lambda _: rest, path.at(duration)[0] if goal is None else goal)

    def given(self, distribution: WeightDistribution, known: Sequence[Known]) -> WeightDistribution:
        """Returns a distribution of weights after conditioning on known points and time derivatives."""
        rows = np.vstack([self.rows(each.progress, each.is_rate) for each in known])
        stds = np.array([max(each.std, EXACT_STD) for each in known])
        return distribution.given(rows, np.concatenate([each.values for each in known]), np.repeat(stds**2, self._dof))

    def check(
        self, distribution: WeightDistribution, known: Sequence[Known], duration_s: float, progress: float
    ) -> None:
        """Checks the mean motion of a distribution.

        Args:
            distribution: Distribution of the weights.
            known: Points that the motion should pass through; known time derivatives are ignored.
            duration_s: Duration of the motion [s].
            progress: Time at which the check begins, as a fraction of the duration.

        Raises:
            PlanError: If the mean motion misses a known point, or leaves the range of positions that the option `reach`
                permits. Also if the motion turns from the mean orientation by more than a whole turn.
        """
        n = len(self.space.names)
        looks = LOOKS[LOOKS >= progress]
        path = distribution.mean.reshape(self._dof, -1) @ self._basis.values(looks).T
        ahead = [each for each in known if not each.is_rate and each.progress >= progress]
        for each in ahead:
            self._check_reach(each.subject, each.values[:n, None], np.array([each.progress]) * duration_s)
        self._check_reach("plan", path[:n], looks * duration_s)
        angles = np.linalg.norm(path[n:], axis=0)
        if angles.max(initial=0.0) > MAX_TURN_RAD:
            got = f"{angles.max():.3g} rad at {looks[int(np.argmax(angles))] * duration_s:.3g} s"
            raise PlanError("plan", f"at most {MAX_TURN_RAD:.3g} rad from the mean orientation", got)
        for each in ahead:
            miss = self.rows(each.progress) @ distribution.mean - each.values
            distance, angle = float(np.abs(miss[:n]).max()), float(np.linalg.norm(miss[n:]))
            spread = MISSED_STDS * each.std
            if distance > TOLERANCE + spread or angle > TOLERANCE_RAD + spread:
                expected = f"to be passed within {TOLERANCE + spread:.3g} m (or rad, for joints)"
                expected += f" and {TOLERANCE_RAD + spread:.3g} rad" if angle else ""
                raise PlanError(each.subject, expected, f"a miss by {distance:.3g} and {angle:.3g} rad")

    def _check_reach(self, subject: str, path: Array, times_s: Array) -> None:
        """Raises a PlanError if positions at m times, shape (n, m), are too far from the demonstrated positions."""
        least, most, reach = self._least[: len(path)], self._most[: len(path)], self.config.reach
        room = reach * max(float((most - least).max()), MIN_EXTENT)
        beyond = np.maximum(least[:, None] - path, path - most[:, None])
        index, at = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[index, at] > room:
            name, limits = self.space.names[index], f"{least[index] - room:.3g} to {most[index] + room:.3g}"
            expected = f"{name} from {limits}, within {reach:g} shown extents (option 'reach') of the demonstrations"
            raise PlanError(subject, expected, f"{path[index, at]:.3g} at {times_s[at]:.3g} s")

    def rows(self, progress: float, is_rate: bool = False) -> Array:
        """Returns the matrix that maps all weights to the coordinates at a time, shape (dof, dof * k).

        Args:
            progress: The time, as a fraction of the duration.
            is_rate: Whether the matrix gives the time derivatives of the coordinates, for a duration of 1 s.
        """
        basis = self._basis.rates if is_rate else self._basis.values
        return np.kron(np.eye(self._dof), basis(np.array(progress)))

    def coordinates(self, point: Array) -> Array:
        """Converts a point to coordinates, shape (dof,): positions, and rotation vector from the mean orientation."""
        return self.space.minus(point, self._origin)

    def mean_at(self, distribution: WeightDistribution, progress: float) -> tuple[Array, Array]:
        """Returns the mean motion's point, and its velocity for a duration of 1 s, shape (dof,).

        Args:
            distribution: Distribution of the weights.
            progress: Time as a fraction of the duration; after 1, the motion is at rest.
        """
        weights, u = distribution.mean.reshape(self._dof, -1), np.array(min(progress, 1.0))
        coordinates, rates = weights @ self._basis.values(u), weights @ self._basis.rates(u)
        if progress > 1.0:
            rates = np.zeros(self._dof)
        n = len(self.space.names)
        if self.space.has_orientation:
            rates[n:] = angular_velocity(coordinates[n:], rates[n:])
        return self.space.plus(self._origin, coordinates), rates

    def stds(self, progress: ArrayLike, distribution: WeightDistribution | None = None) -> Array:
        """Returns the standard deviations of the coordinates, shape (m, dof) [m or rad].

        Args:
            progress: m times, as fractions of the duration.
            distribution: Distribution of the weights, such as a result of `conditioned`; by default the learned one.
        """
        k = len(self._basis.centers)
        covariance = (distribution or self.distribution).covariance.reshape(self._dof, k, self._dof, k)
        blocks = np.array([covariance[i, :, i] for i in range(self._dof)])
        values = self._basis.values(np.asarray(progress, dtype=float))
        return np.asarray(np.sqrt(np.maximum(np.einsum("mk,dkl,ml->md", values, blocks, values), 0.0)))

    def conditioned(self, via_points: Sequence[ViaPoint]) -> WeightDistribution:
        """Returns the distribution of the weights after conditioning on via-points.

        Raises:
            PlanError: If a via-point is not a point of the space.
        """
        known = []
        for index, each in enumerate(via_points):
            subject = f"via_points[{index}]"
            point = self.space.point(each.point, subject)
            known.append(Known(subject, each.progress, self.coordinates(point), each.std))
        return self.given(self.distribution, known)

    def _learned(self) -> LearnedProMP:
        return LearnedProMP(origin=self._origin.tolist(), duration_s=self._duration_s, weights=self._weights.tolist())

    def _restore(self, space: Space, learned: Any) -> None:
        shape = {"demonstrations": len(learned.weights), "signals": space.dof, "bases": self.config.bases}
        weights = check_shape(learned.weights, shape, "weights")
        if not len(weights):
            raise ValueError("weights: expected at least one demonstration, got none")
        self._set(space, space.point(learned.origin, "origin"), learned.duration_s, weights)
