"""Steps from a configuration: to the target, near it, or along its solutions to a posture."""

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
"""A method that brings a link nearer to its target; limits are not considered.

Its arguments are m start positions [rad or m], the joints to hold, and the largest number of iterations; it returns m
positions.
"""
BREAK_S = 5e-5
"""Pause between stages, which lets the simulation take Python's lock [s]."""
FROZEN = 1e6
"""Damping that keeps a joint where it is."""
DAMPING = 1e-3
"""Damping of the joint with the least weight; PyBullet's own 0.5 needs some hundred iterations rather than ten."""
JOINT_ITERATIONS_A_CALL = 140
"""Iterations in one call of PyBullet, times the number of joints: it holds Python's lock meanwhile, some 0.1 ms."""


class DampedLeastSquares:
    """PyBullet's damped least squares.

    Args:
        threshold_m: Distance at which to stop [m].
        damping: Weight of the motion of each of the m joints; the least is 1.
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
"""Largest motion of a joint in one step [rad or m], as in the paper."""


class SelectivelyDampedLeastSquares:
    """Selectively damped least squares; our own, since PyBullet's ends the process (bullet3 issue 4404).

    After Buss and Kim, Selectively Damped Least Squares for Inverse Kinematics, Journal of Graphics Tools 10(3), 2005.
    The arguments are those of `DampedLeastSquares`.
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
    """Returns the m joints' step for an error; each singular direction is damped by the joint motion that it needs."""
    lengths = np.linalg.norm(jacobian, axis=0)  # how much the link moves with each joint
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
"""Largest motion of a joint of weight 1 in one step [rad or m]."""
DONE = 1e-3
"""Step of such a joint below which the search ends [rad or m]."""
POSTURE_DAMPING = 1e-6
"""Keeps the pseudo-inverse finite where the link cannot move in all directions."""


def towards_posture(
    chain: BulletChain, target: Target, limits: Limits, rest: np.ndarray, ranges: np.ndarray, q: np.ndarray, size: float
) -> np.ndarray:
    """Slides along all solutions of a problem to the one nearest to a rest posture.

    A gradient projection: each step moves towards the posture in the null space of the link, and corrects the error of
    the last one (Liegeois, IEEE Transactions on Systems, Man, and Cybernetics 7(12), 1977).

    Args:
        target: Pose of the link, to be held.
        limits: Limits of its m joints.
        rest: m positions of the posture [rad or m].
        ranges: m weights, 1 at most: a joint may be as far from its rest as its range is wide.
        q: m positions of the solution to start from.
        size: Residual that a solution may have, see `Residual.size`.

    Returns:
        The best solution that was found; `q` itself if there is none that is nearer.
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
    """Returns the step that corrects the error and is nearest to the desired one; joints stop at their limits."""
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
    """Minimises the distance of the link from a target that may be out of reach.

    By L-BFGS-B (Byrd, Lu, Nocedal and Zhu, SIAM Journal on Scientific Computing 16(5), 1995).

    Returns:
        m positions [rad or m], and the distance from the target: the norm of distance and angle, each divided by its
        tolerance.
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
