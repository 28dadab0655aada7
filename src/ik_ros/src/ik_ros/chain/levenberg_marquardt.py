"""The Levenberg-Marquardt method for inverse kinematics, with joint limits and target tolerances."""

import math
from collections.abc import Sequence

import numpy as np

from robot_model.limits import Limits
from robot_model.linear_algebra import solve

from .kdl import Goal, KdlChain

ITERATIONS = 60
LEVER_M = 0.1
"""Length that converts rotation errors to metres [m]: 0.01 rad count as 1 mm."""
DONE_M = 1e-5
"""Error up to which the goal counts as reached, which ends the descent [m]."""
LARGEST_STEP = 1.0
"""Largest motion of a joint in one iteration [rad or m]."""
LEAST_DAMPING, FIRST_DAMPING, LARGEST_DAMPING = 1e-9, 1e-4, 1e2
STALLED = 0.99
"""Ratio of successive squared errors above which an iteration counts as stalled."""
PATIENCE = 3
"""Number of successive stalled iterations after which the descent ends."""


def levenberg_marquardt(chain: KdlChain, goal: Goal, limits: Limits, start: Sequence[float]) -> list[float]:
    """Searches for joint positions that bring the tip of a chain to a goal, by descent from start positions.

    The descent minimises the part of the error that exceeds the goal's tolerances. In each iteration, a joint at a
    limit is held if descent would move the joint beyond the limit.

    Args:
        chain: The chain, with n joints to solve for.
        goal: The goal of the tip.
        limits: Limits of the n joints.
        start: n positions within the limits [rad or m].

    Returns:
        The best joint positions that were found: n positions within the limits [rad or m].
    """
    lower, upper = np.array(limits.lower), np.array(limits.upper)
    to_target = np.array([[goal.inverse.M[row, column] for column in range(3)] for row in range(3)])
    q = np.array(start)
    error, turn = _error(chain, goal, q)
    cost, damping, patience = float(error @ error), FIRST_DAMPING, PATIENCE
    for _ in range(ITERATIONS):
        if cost <= DONE_M**2 or patience == 0 or damping > LARGEST_DAMPING:
            break
        jacobian = _jacobian(chain, q, to_target, turn)
        jacobian[error == 0.0] = 0.0  # errors within their tolerance do not restrict the step
        gradient = jacobian.T @ error
        free = ~(((q <= lower) & (gradient > 0.0)) | ((q >= upper) & (gradient < 0.0)))
        if not free.any():
            break
        jacobian = jacobian[:, free]
        square = jacobian.T @ jacobian
        while damping <= LARGEST_DAMPING:
            step = np.zeros(len(q))
            step[free] = -solve(square + damping * np.eye(len(square)), gradient[free])
            step *= min(1.0, LARGEST_STEP / max(np.abs(step).max(), 1e-12))
            moved = np.clip(q + step, lower, upper)
            moved_error, moved_turn = _error(chain, goal, moved)
            moved_cost = float(moved_error @ moved_error)
            if moved_cost < cost:
                patience = PATIENCE if moved_cost < STALLED * cost else patience - 1
                q, error, turn, cost = moved, moved_error, moved_turn, moved_cost
                damping = max(0.2 * damping, LEAST_DAMPING)
                break
            damping *= 5.0
    return list(q.tolist())


def _error(chain: KdlChain, goal: Goal, q: np.ndarray) -> tuple[np.ndarray, list[float]]:
    """Returns the parts of the 6 errors that exceed the tolerances, and the rotation vector from target to link [rad].

    Rotation errors are multiplied by `LEVER_M`, so that all errors are in metres.
    """
    off = goal.off(chain.frame(q.tolist()))
    error = np.array(goal.beyond(off))
    error[3:] *= LEVER_M
    return error, off[3:]


def _jacobian(chain: KdlChain, q: np.ndarray, to_target: np.ndarray, turn: Sequence[float]) -> np.ndarray:
    """Returns the derivatives of the 6 errors with respect to the n joint positions, 6 x n; ignores tolerances.

    The derivative of a rotation vector is the inverse left Jacobian of SO(3) times the angular velocity (Barfoot, State
    Estimation for Robotics, 2017, section 7.1.5).

    Args:
        chain: The chain.
        q: n joint positions [rad or m].
        to_target: Rotation matrix that converts base coordinates to target coordinates, 3 x 3.
        turn: Rotation vector from target to link [rad].
    """
    x, y, z = turn
    angle = math.hypot(x, y, z)
    half = 0.5 * angle
    factor = (1.0 - half / math.tan(half)) / angle**2 if angle > 1e-4 else 1.0 / 12.0
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    to_vector = np.eye(3) - 0.5 * cross + factor * cross @ cross
    jacobian = chain.jacobian(q.tolist())
    return np.vstack((to_target @ jacobian[:3], LEVER_M * to_vector @ to_target @ jacobian[3:]))
