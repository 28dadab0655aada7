"""Numerical methods of inverse kinematics: they move a link to a target, or joints towards a rest posture."""

import math
import time
from collections.abc import Callable

import numpy as np
import pybullet

from robot_model.limits import Limits
from robot_model.linear_algebra import inverse
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M

from .chain import BulletChain, Target

Step = Callable[[np.ndarray, np.ndarray, int], np.ndarray]
"""Function that moves m joints such that a link approaches its target, without regard to joint limits.

Arguments: m start positions [rad or m]; m booleans, whether to hold each joint; the maximum number of iterations.
Returns m positions [rad or m].
"""
BREAK_S = 5e-5
"""Pause [s] between stages, in which the simulation thread can take Python's global interpreter lock."""
FROZEN = 1e6
"""Damping with which a joint does not move."""
DAMPING = 1e-3
"""Damping for the relative damping 1. PyBullet's default of 0.5 needs 100 iterations instead of 10."""
JOINT_ITERATIONS_A_CALL = 140
"""Iterations in one call of PyBullet, times the number of joints.

During a call, some 0.1 ms, PyBullet holds Python's global interpreter lock.
"""


class DampedLeastSquares:
    """Moves joints towards a link's target by damped least squares in PyBullet.

    Instances are functions of type `Step`.

    Args:
        chain: Chain of the m joints that move the link.
        target: Target of the link.
        threshold_m: Distance [m] from the target at which iterations stop.
        damping: Relative damping of each of the m joints of the chain; the smallest is 1. A joint with a larger damping
            moves less.
    """

    def __init__(self, chain: BulletChain, target: Target, threshold_m: float, damping: np.ndarray) -> None:
        self._chain = chain
        self._damping = DAMPING * damping
        self._arguments = {"targetPosition": target.position, "residualThreshold": threshold_m}
        if target.quat_xyzw is not None:
            self._arguments["targetOrientation"] = target.quat_xyzw

    def __call__(self, q: np.ndarray, frozen: np.ndarray, iterations: int) -> np.ndarray:
        damping = np.where(frozen, FROZEN, self._damping).tolist()
        a_call = max(1, JOINT_ITERATIONS_A_CALL // len(q))
        for done in range(0, iterations, a_call):
            q = self._call(q, damping, min(a_call, iterations - done))
        return q

    def _call(self, q: np.ndarray, damping: list[float], iterations: int) -> np.ndarray:
        chain = self._chain
        chain.set(q)
        return np.array(
            chain.pb.calculateInverseKinematics(
                chain.body_id,
                chain.link_index,
                jointDamping=damping,
                maxNumIterations=iterations,
                solver=pybullet.IK_DLS,
                **self._arguments,
            )
        )


LARGEST_STEP = np.pi / 4
"""Largest motion [rad or m] of a joint in one step, as in the paper by Buss and Kim."""


class SelectivelyDampedLeastSquares:
    """Moves joints towards a link's target by selectively damped least squares.

    Instances are functions of type `Step`. The arguments are those of `DampedLeastSquares`.

    After Buss and Kim, Selectively Damped Least Squares for Inverse Kinematics, Journal of Graphics Tools 10(3), 2005.
    PyBullet's own implementation crashes the process (bullet3 issue 4404).
    """

    def __init__(self, chain: BulletChain, target: Target, threshold_m: float, damping: np.ndarray) -> None:
        self._chain, self._target, self._threshold_m = chain, target, threshold_m
        self._willingness = 1.0 / np.sqrt(damping)

    def __call__(self, q: np.ndarray, frozen: np.ndarray, iterations: int) -> np.ndarray:
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
    """Returns the step of m joints, shape (m,), with which the joints reduce an error of the link.

    The step is a sum of one step for each singular vector of the Jacobian. The limit of such a step is lower if more
    joint motion is needed to move the link along the singular vector.
    """
    lengths = np.linalg.norm(jacobian, axis=0)  # motion of the link per unit motion of each joint
    step = np.zeros(jacobian.shape[1])
    left, singular_values, right = np.linalg.svd(jacobian, full_matrices=False)
    for u, sigma, v in zip(left.T, singular_values, right):
        if sigma < 1e-9:
            continue
        moved = np.abs(v) @ lengths / sigma  # motion of all joints for a unit step in this direction
        largest = min(1.0, 1.0 / moved) * LARGEST_STEP
        step += _clamped(v * (u @ error) / sigma, largest)
    return _clamped(step, LARGEST_STEP)


def _clamped(step: np.ndarray, largest: float) -> np.ndarray:
    size = np.abs(step).max()
    return step * (largest / size) if size > largest else step


POSTURE_STEPS = 60
LARGEST_POSTURE_STEP = 0.2
"""Largest motion [rad or m] of a joint of weight 1 in one step."""
DONE = 1e-3
"""Step [rad or m] of a joint of weight 1 below which the search ends."""
POSTURE_DAMPING = 1e-6
"""Damping that keeps the pseudo-inverse finite at singular configurations."""


def towards_posture(
    chain: BulletChain, target: Target, limits: Limits, rest: np.ndarray, ranges: np.ndarray, q: np.ndarray, size: float
) -> np.ndarray:
    """Moves from a solution towards a rest posture, while the link stays at the target.

    Uses gradient projection: each step moves towards the posture in the null space of the link's Jacobian, and corrects
    the error of the previous step (Liegeois, IEEE Transactions on Systems, Man, and Cybernetics 7(12), 1977).

    Args:
        chain: Chain of the m joints that move the link.
        target: Target of the link.
        limits: Limits of the m joints.
        rest: m positions [rad or m] of the posture.
        ranges: m weights up to 1, proportional to the joints' ranges. A joint's distance from the posture is divided by
            the joint's weight.
        q: m positions [rad or m] of the first solution.
        size: Maximum residual of a solution, see `Residual.size`.

    Returns:
        m positions of the solution nearest to the posture; `q` if no nearer solution was found.
    """
    best, best_cost = q, _cost(q, rest, ranges)
    least, most = np.array(limits.lower), np.array(limits.upper)
    for _ in range(POSTURE_STEPS):
        chain.set(q)
        error = chain.error(target)
        scaled = chain.jacobian(q, len(error)) * ranges
        step = _step(scaled, error, (rest - q) / ranges, (least - q) / ranges, (most - q) / ranges)
        q = np.clip(q + step * ranges, least, most)
        cost = _cost(q, rest, ranges)
        if cost < best_cost and chain.residual(target, q).size <= size:
            best, best_cost = q, cost
        if np.abs(step).max() < DONE:
            break
    return best


def _cost(q: np.ndarray, rest: np.ndarray, ranges: np.ndarray) -> float:
    return float(np.sum(((q - rest) / ranges) ** 2))


def _step(
    jacobian: np.ndarray, error: np.ndarray, wish: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Returns the joint step nearest to a desired step among the steps that correct the link's error.

    Joints stop at their limits. Each joint's steps are divided by the joint's weight, see `towards_posture`.

    Args:
        jacobian: Jacobian of the link, multiplied by the joints' weights.
        error: Error of the link to its target.
        wish: Desired step of the m joints.
        lower: Steps of the m joints to their lower limits.
        upper: Steps of the m joints to their upper limits.
    """
    step = np.zeros(len(wish))
    free = np.ones(len(wish), dtype=bool)
    for _ in range(len(wish)):
        J = jacobian[:, free]
        pseudoinverse = J.T @ inverse(J @ J.T + POSTURE_DAMPING * np.eye(len(J)))
        rest = error - jacobian[:, ~free] @ step[~free]
        mended, wished = pseudoinverse @ rest, wish[free] - pseudoinverse @ (J @ wish[free])
        most = np.abs(wished).max(initial=0.0)
        step[free] = mended + wished * min(1.0, LARGEST_POSTURE_STEP / most if most else 1.0)
        beyond = free & ((step < lower) | (step > upper))
        if not beyond.any():
            break
        step[beyond] = np.clip(step, lower, upper)[beyond]
        free = free & ~beyond
    return step


def go_near(chain: BulletChain, target: Target, limits: Limits, q: np.ndarray, steps: int) -> tuple[np.ndarray, float]:
    """Minimizes the error of the link to a target that may be out of reach.

    Uses L-BFGS-B (Byrd, Lu, Nocedal and Zhu, SIAM Journal on Scientific Computing 16(5), 1995).

    Args:
        chain: Chain of the m joints that move the link.
        target: Target of the link.
        limits: Limits of the m joints.
        q: m start positions [rad or m].
        steps: Maximum number of iterations.

    Returns:
        m positions [rad or m], and the remaining error: the norm of distance and angle, each divided by its tolerance.
    """
    from scipy.optimize import minimize  # slow to import, and seldom used

    weights = 1.0 / np.array([POSITION_TOLERANCE_M] * 3 + [ORIENTATION_TOLERANCE_RAD] * 3)

    def square(q: np.ndarray) -> tuple[float, np.ndarray]:
        chain.set(q)
        error = chain.error(target)
        weighted = error * weights[: len(error)] ** 2
        return float(error @ weighted), -2.0 * chain.jacobian(q, len(error)).T @ weighted

    least, _ = square(q)
    scale = max(least, 1.0)
    found = minimize(
        lambda q: tuple(part / scale for part in square(q)),
        q,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(limits.lower, limits.upper)),
        options={"maxiter": steps},
        callback=lambda _: time.sleep(BREAK_S),
    )
    return found.x, math.sqrt(found.fun * scale)
