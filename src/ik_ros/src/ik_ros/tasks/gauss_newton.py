"""Gauss-Newton search for a configuration, with one quadratic program per step."""

from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import daqp
import numpy as np

from robot_model.reach import Residual

from .formulation import Part
from .joint_task import JointTask
from .robot import PinocchioRobot
from .task import Linearization


class Candidate(NamedTuple):
    """A configuration with its errors.

    Attributes:
        q: The configuration.
        residuals: Error of each required task, indexed by task name.
        size: Largest error of a required task, as a multiple of the task's tolerance.
        hard_size: Largest error of a constraint, as a multiple of the constraint's tolerance.
    """

    q: np.ndarray
    residuals: dict[str, Residual]
    size: float
    hard_size: float

    @property
    def rank(self) -> tuple[float, float]:
        """Sort key that compares constraints first; smaller is better. Errors within the tolerances count as equal."""
        return max(self.hard_size, 1.0), max(self.size, 1.0)


LARGEST_STEP = 1.0
"""Largest motion of a joint, or of the base along or about an axis, in one step [rad or m]."""
DAMPING = 1e-3
"""Factor of the weighted squared errors in the damping of a step."""
LEAST_DAMPING = 1e-6
"""Constant part of the damping of a step."""
FIRST_DAMPING, TIGHTENING, EASING = 1e-4, 10.0, 0.2
"""Additional damping: its value after the first rejected step, and its factors at each rejected and accepted step."""
HARD = 1e4
"""Weight of constraints in the merit of a configuration, see `Iterate.merit`."""
MEMORY = 2
"""Number of accepted configurations to compare with. A step is accepted if its merit is at most their largest merit."""
SLACK = 1e-6
"""DAQP's parameter `rho_soft`, the penalty for violating a soft constraint."""
SOFT = 8
"""DAQP's flag for a soft constraint (`sense` in DAQP's documentation)."""
UNBOUNDED = 1e30


class Iterate(NamedTuple):
    """An intermediate configuration of the search.

    Attributes:
        q: The configuration.
        rows: Linearisation of each task at q.
        beyond: Amounts by which the values of each task violate their bounds.
        merit: Weighted sum of the squared violations; smaller is better.
        step: Largest motion of a joint, or of the base, since the last accepted configuration [rad or m].
    """

    q: np.ndarray
    rows: list[Linearization]
    beyond: list[np.ndarray]
    merit: float
    step: float


class GaussNewton:
    """Minimises the costs subject to the constraints with Gauss-Newton steps.

    Each step minimises the weighted squares of the linearised costs plus a damping term, subject to the linearised
    constraints and the joint limits. Constraints are soft with a large penalty, so that a step is possible even if
    constraints conflict.

    Args:
        robot: The robot.
        parts: The costs and constraints.

    Attributes:
        lower: Lower limits of the n joints for the current problem [rad or m].
        upper: Upper limits of the n joints for the current problem [rad or m].
    """

    def __init__(self, robot: PinocchioRobot, parts: Sequence[Part]) -> None:
        self._robot, self._parts = robot, tuple(parts)
        self._count = len(robot.free)
        self._of_base = self._count - len(robot.joint_names)
        self._least = np.full(self._count, -LARGEST_STEP)
        self._weights = [HARD if part.is_hard else part.task.config.weight for part in self._parts]
        self._no_rows = np.zeros((0, self._count))
        self._sense = np.zeros(self._count, dtype=np.intc)
        self.begin()

    def begin(self) -> None:
        """Computes the joint limits for a new problem, for which each task's `begin` must have been called before.

        Constraints on joint positions narrow the limits, so that each step satisfies these constraints exactly.
        """
        self.lower, self.upper = self._robot.lower.copy(), self._robot.upper.copy()
        for part in self._parts:
            if part.is_hard and isinstance(part.task, JointTask):
                i = part.task.indices
                lower, upper = part.task.bounds
                self.lower[i] = np.minimum(np.maximum(self.lower[i], lower), self.upper[i])
                self.upper[i] = np.maximum(np.minimum(self.upper[i], upper), self.lower[i])

    def __call__(self, q: np.ndarray) -> Iterator[Iterate]:
        """Searches from the configuration q, clipped to the joint limits.

        Yields each tried configuration, even if it is worse than the configurations before. The search does not end
        unless a quadratic program fails.
        """
        q = self._robot.moved(q, np.zeros(self._count), self.lower, self.upper)
        damping, merits = 0.0, deque([np.inf], MEMORY)
        here = tried = self._at(q, np.inf)
        while True:
            yield tried
            if tried.merit <= max(merits):
                here, damping = tried, EASING * damping
                merits.append(here.merit)
            else:
                damping = max(TIGHTENING * damping, FIRST_DAMPING)
            way = self._step(here, damping)
            if way is None:
                return
            tried = self._at(self._robot.moved(here.q, way, self.lower, self.upper), max(map(abs, way.tolist())))

    def _at(self, q: np.ndarray, step: float) -> Iterate:
        self._robot.update(q)
        rows = [part.task.rows(q) for part in self._parts]
        beyond = [one.beyond() for one in rows]
        merit = sum(weight * float(over @ over) for weight, over in zip(self._weights, beyond))
        return Iterate(q, rows, beyond, merit, step)

    def _step(self, here: Iterate, damping: float) -> np.ndarray | None:
        """Computes the next step of the m components in `PinocchioRobot.free`; None if the quadratic program fails."""
        hessian = np.zeros((self._count, self._count))
        gradient = np.zeros(self._count)
        off = 0.0
        hard: list[Linearization] = []
        for part, wanted, over in zip(self._parts, here.rows, here.beyond):
            if part.is_hard:
                if not isinstance(part.task, JointTask):
                    off += float(over @ over)
                    hard.append(wanted)
                continue
            jacobian, weight = wanted.jacobian, part.task.config.weight
            if not wanted.is_exact:  # values within their bounds cost nothing
                outside = over != 0.0
                jacobian, over = jacobian[outside], over[outside]
            off += weight * float(over @ over)
            hessian += weight * (jacobian.T @ jacobian)
            gradient += weight * (over @ jacobian)
        hessian.flat[:: self._count + 1] += LEAST_DAMPING + DAMPING * off + damping
        positions = self._robot.positions(here.q)
        lower, upper = self._least.copy(), -self._least
        lower[self._of_base :] = np.maximum(lower[self._of_base :], self.lower - positions)
        upper[self._of_base :] = np.minimum(upper[self._of_base :], self.upper - positions)
        matrix, sense = self._no_rows, self._sense
        if hard:
            matrix = np.concatenate([one.jacobian for one in hard])
            lower = np.concatenate([lower, *(np.maximum(one.lower - one.values, -UNBOUNDED) for one in hard)])
            upper = np.concatenate([upper, *(np.minimum(one.upper - one.values, UNBOUNDED) for one in hard)])
            sense = np.full(len(lower), SOFT, dtype=np.intc)
            sense[: self._count] = 0
        way, _, flag, _ = daqp.solve(hessian, gradient, matrix, upper, lower, sense, rho_soft=SLACK)
        return way if flag > 0 and np.isfinite(way).all() else None
