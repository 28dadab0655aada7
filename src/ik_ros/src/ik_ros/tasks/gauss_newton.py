"""Gauss-Newton steps from one configuration to a better one, by quadratic programs."""

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
    """A configuration.

    Attributes:
        q: The configuration.
        residuals: Error of each required task.
        size: The largest residual as a multiple of its tolerance.
        hard_size: The same of constraints alone.
    """

    q: np.ndarray
    residuals: dict[str, Residual]
    size: float
    hard_size: float

    @property
    def rank(self) -> tuple[float, float]:
        """Key by which results are compared: constraints first; all results within tolerances are equal."""
        return max(self.hard_size, 1.0), max(self.size, 1.0)


LARGEST_STEP = 1.0
"""Largest motion of a joint, or of the base along or about an axis, in one step [rad or m]."""
DAMPING = 1e-3
"""Damping of steps as a share of the squared residual."""
LEAST_DAMPING = 1e-6
"""Smallest damping of steps."""
FIRST_DAMPING, TIGHTENING, EASING = 1e-4, 10.0, 0.2
"""Damping after a failed step: its smallest value, its growth with each failure, and its decrease after a success."""
HARD = 1e4
"""Weight of constraints in the merit of a step."""
MEMORY = 2
"""Number of previous steps; a step has to be better than the worst of them, otherwise a shorter one is tried."""
SLACK = 1e-6
"""Penalty for violating a constraint in favour of costs or conflicting constraints."""
SOFT = 8
"""DAQP's number for a soft constraint (`sense` in its documentation)."""
UNBOUNDED = 1e30


class Iterate(NamedTuple):
    """An intermediate configuration.

    Attributes:
        q: The configuration.
        rows: Linearisation of each task there.
        beyond: Violation of its bounds by each.
        merit: The sum of the weighted squares of the violations.
        step: Largest motion of a joint, or of the base, from the last better one [rad or m].
    """

    q: np.ndarray
    rows: list[Linearization]
    beyond: list[np.ndarray]
    merit: float
    step: float


class GaussNewton:
    """Minimises the costs such that the constraints hold, by Gauss-Newton steps.

    Each step minimises the weighted squares of the linearised costs plus a damping, subject to the linearised
    constraints and the joint limits. Constraints are soft with a large penalty, so there always is a step.

    Attributes:
        lower: n lower limits of the joints [rad or m].
        upper: n upper limits.
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
        """Sets the bounds of the tasks for a new problem.

        Constraints on joints alone narrow the limits, so they are satisfied exactly.
        """
        self.lower, self.upper = self._robot.lower.copy(), self._robot.upper.copy()
        for part in self._parts:
            if part.is_hard and isinstance(part.task, JointTask):
                i = part.task.indices
                lower, upper = part.task.bounds
                self.lower[i] = np.minimum(np.maximum(self.lower[i], lower), self.upper[i])
                self.upper[i] = np.maximum(np.minimum(self.upper[i], upper), self.lower[i])

    def __call__(self, q: np.ndarray) -> Iterator[Iterate]:
        """Yields each configuration of the search from q, also worse ones; joints beyond their limits start at the
        limit."""
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
        """Returns the step, None if there is none."""
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
