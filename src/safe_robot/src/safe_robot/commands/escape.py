"""The motion by which a robot leaves margins: it separates all pairs that are too near at once."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from robot_model.collision.distances import Pair
from safe_robot.check import MarginViolation
from safe_robot.limits import MotionLimits

STEP = 1e-3
"""Test step: a motion counts if pairs are further apart after the fastest joint has moved this far [rad or m]."""
MIN_SPEED_SHARE = 0.05
"""A motion counts if it separates each pair at least at this share of the fastest separation of that pair alone."""
MIN_GAIN_SHARE = 0.1
"""Least share of its expected gain that a motion has to reach."""
TRIES = 12
MIN_GRADIENT = 1e-4
"""Norm of a gradient below which no joint counts as moving a pair apart [m/rad or 1]."""


class EscapeDirection(NamedTuple):
    """Violations of margins, and the motion that leaves them.

    Attributes:
        inside: Violations of margins; if it is locked, also those that a motion would cause.
        direction: Motion of n joints that increases all distances; the largest is 1 or -1. None: no motion does.
    """

    inside: Sequence[MarginViolation]
    direction: np.ndarray | None

    @property
    def is_locked(self) -> bool:
        """Whether no motion separates all pairs at once."""
        return self.direction is None

    def words(self, joint_names: Sequence[str]) -> str:
        """Returns a sentence that describes it."""
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
    """Returns the motion of n joints that leaves violated margins; None if no margin is violated.

    It is a linear program: the largest t with `gradient @ direction >= t |gradient|` for all pairs, no joint faster
    than 1, none further out of its limits. If t is at most `MIN_SPEED_SHARE` there is no direction. Distances have
    kinks, for instance where another corner becomes the nearest. The motion is therefore tested, and each pair that
    comes nearer is added as a row.

    Args:
        q: n positions.
        limits: Limits of the joints.
        inside: Returns the margin violations of a configuration.
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
