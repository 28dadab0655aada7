"""Search for a joint motion that reduces all violations of safety margins at once."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from robot_model.collision.distances import Pair
from safe_robot.check import MarginViolation
from safe_robot.limits import MotionLimits

STEP = 1e-3
"""Length of the step with which a motion is tested: the displacement of the fastest joint [rad or m]."""
MIN_SPEED_SHARE = 0.05
"""Smallest separation speed of a pair that counts, as a share of the norm of the pair's gradient."""
MIN_GAIN_SHARE = 0.1
"""Share of the predicted increase of each distance that the test step has to reach."""
TRIES = 12
MIN_GRADIENT = 1e-4
"""Smallest norm of a gradient that is used; smaller norms are replaced by this value [m/rad or 1]."""


class EscapeDirection(NamedTuple):
    """Margin violations at a configuration, and a joint motion that increases the distances of all violating pairs.

    Attributes:
        inside: The margin violations. If no motion was found, also violations that the tested motions would cause.
        direction: Joint velocities of the motion, shape (n,), scaled such that the largest absolute value is 1. None if
            no such motion was found.
    """

    inside: Sequence[MarginViolation]
    direction: np.ndarray | None

    @property
    def is_locked(self) -> bool:
        """Whether the search for a motion that separates all violating pairs at once has failed."""
        return self.direction is None

    def words(self, joint_names: Sequence[str]) -> str:
        """Returns a message about the violations and, if found, about the joint motion that reduces the violations."""
        each = ", ".join(
            f"{one.check} ({one.subject}: {1e3 * one.distance_m:.1f} of {1e3 * one.margin_m:.1f} mm)"
            for one in self.inside
        )
        if self.direction is None:
            return f"locked inside the margin of {each}: no motion separates all of them"
        way = ", ".join(
            f"{name} {speed:+.2f}" for name, speed in zip(joint_names, self.direction) if abs(speed) > 0.005
        )
        return f"inside the margin of {each}: {way} leads away"


def find_escape(
    q: np.ndarray, limits: MotionLimits, inside: Callable[[np.ndarray], Sequence[MarginViolation]]
) -> EscapeDirection | None:
    """Returns the margin violations at a configuration, and a joint motion that reduces all violations.

    The motion solves a linear program: maximise t subject to `gradient @ direction >= t |gradient|` for all violating
    pairs. Joint speeds are at most 1, and a joint at a position limit may not move further out. The search fails if t
    is at most `MIN_SPEED_SHARE`.

    Gradients of distances can change abruptly, for instance where another corner becomes the nearest. Therefore, a
    small step along the motion is tested. The gradients of pairs that do not separate as predicted are added to the
    program, which is then solved again.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        limits: Limits of the joints.
        inside: Computes the margin violations at n joint positions.

    Returns:
        The violations and the motion; None if no margin is violated.
    """
    now = inside(q)
    if not now:
        return None
    known = {(one.check, one.pair): one for one in now}
    before = {key: one.distance_m for key, one in known.items()}
    in_the_way = dict[tuple[str, Pair], MarginViolation]()
    gradients = [one.gradient for one in now]
    low, high = np.where(q <= limits.lower + STEP, 0.0, -1.0), np.where(q >= limits.upper - STEP, 0.0, 1.0)
    for _ in range(TRIES):
        steepest = np.maximum([float(np.linalg.norm(gradient)) for gradient in gradients], MIN_GRADIENT)
        rows = np.column_stack((-np.array(gradients), steepest))
        cost = np.append(np.zeros(len(q)), -1.0)
        bounds = [*zip(low, high), (None, None)]
        found = linprog(cost, A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds)
        if not found.success or found.x[-1] <= MIN_SPEED_SHARE:
            break
        direction = found.x[:-1] / np.abs(found.x[:-1]).max()
        gain = MIN_GAIN_SHARE * STEP * found.x[-1]
        nearer = []
        for one in inside(q + STEP * direction):
            expected_m = gain * float(np.linalg.norm(one.gradient))
            if one.distance_m < before.get((one.check, one.pair), one.margin_m) + expected_m:
                nearer.append(one)
        if not nearer:
            return EscapeDirection(now, direction)
        gradients += [one.gradient for one in nearer]
        in_the_way |= {(one.check, one.pair): one._replace(distance_m=one.margin_m) for one in nearer}
    return EscapeDirection([*{**in_the_way, **known}.values()], None)
