"""Rest postures: where a robot with joints to spare stays while its link is at the target."""

from __future__ import annotations

import numpy as np

from .chain import Chain, Target
from .joint_limits import JointLimits

MAX_STEPS = 60
LARGEST_STEP = 0.2
"""Most that a joint of weight 1 moves in one step [rad or m]."""
DONE = 1e-3
"""Size of the step of such a joint at which little is left to gain [rad or m]."""
DAMPING = 1e-6
"""Keeps the pseudo-inverse finite where the link cannot move in all directions."""


def towards_posture(
    chain: Chain, target: Target, limits: JointLimits, rest: np.ndarray, ranges: np.ndarray, q: np.ndarray, size: float
) -> np.ndarray:
    """Slides along all solutions of a problem to the one nearest to a rest posture.

    A gradient projection: each step goes towards the posture as far as it leaves the link alone, and mends what the
    last one spoiled (Liegeois, IEEE Transactions on Systems, Man, and Cybernetics 7(12), 1977).

    Args:
        chain: The link.
        target: Where it is and shall stay.
        limits: Limits of its m joints.
        rest: m positions of the posture [rad or m].
        ranges: m weights, 1 at most: a joint may be as far from its rest as its range is wide.
        q: m positions of the solution to start from.
        size: Residual that a solution may have, see `Residual.size`.

    Returns:
        The best solution that was found; `q` itself if there is none that is nearer.
    """
    best, best_cost = q, _cost(q, rest, ranges)
    for _ in range(MAX_STEPS):
        chain.set(q)
        error = chain.error(target)
        scaled = chain.jacobian(q, len(error)) * ranges
        lower, upper = (limits.lower - q) / ranges, (limits.upper - q) / ranges
        step = _step(scaled, error, (rest - q) / ranges, lower, upper)
        q = np.clip(q + step * ranges, limits.lower, limits.upper)
        chain.set(q)
        cost = _cost(q, rest, ranges)
        if cost < best_cost and chain.residual(target).size <= size:
            best, best_cost = q, cost
        if np.abs(step).max() < DONE:
            break
    return best


def _cost(q: np.ndarray, rest: np.ndarray, ranges: np.ndarray) -> float:
    return float(np.sum(((q - rest) / ranges) ** 2))


def _step(
    jacobian: np.ndarray, error: np.ndarray, wish: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Returns the step that undoes the error and is nearest to the one wished for; joints stop at their limits."""
    step = np.zeros(len(wish))
    free = np.ones(len(wish), dtype=bool)
    for _ in range(len(wish)):
        J = jacobian[:, free]
        inverse = J.T @ np.linalg.inv(J @ J.T + DAMPING * np.eye(len(J)))
        rest = error - jacobian[:, ~free] @ step[~free]
        mended, wished = inverse @ rest, wish[free] - inverse @ (J @ wish[free])
        most = np.abs(wished).max(initial=0.0)
        step[free] = mended + wished * min(1.0, LARGEST_STEP / most if most else 1.0)
        beyond = free & ((step < lower) | (step > upper))
        if not beyond.any():
            break
        step[beyond] = np.clip(step, lower, upper)[beyond]
        free = free & ~beyond
    return step
