"""The learned skill: approaches a box from any start, and pushes the box as demonstrated."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import Array
from motion_primitives import Demonstration, MotionPlan, make_primitive

NAMES = ("x", "y")
MOVED_M = 0.002
"""Largest distance from the first or last position at which the tip counts as at rest [m]."""
GAP_M = 0.025
"""Distance of the tip from the point of first contact at which the approach ends and the push begins [m]."""
MIN_BASES, MAX_BASES, BASES_PER_S = 30, 1000, 20.0
"""Number of basis functions of a primitive: lower and upper limit, and number per second of demonstration."""
ALPHA_PER_S = 25.0
"""Damping of a primitive, divided by the duration of the demonstration [1/s]."""


class ShownPush(NamedTuple):
    """The tip's path in a demonstration, in the person's frame.

    Attributes:
        times: Times of the m samples [s].
        places: Position of the tip in each sample, shape (m, 2) [m].
        contact_s: Time of the first contact with the box [s]. None without contact.
    """

    times: Array
    places: Array
    contact_s: float | None

    def moving(self) -> ShownPush:
        """Returns the part of the demonstration in which the tip moves: from its first to its last motion.

        Raises:
            InterfaceError: If the tip has not moved.
        """
        off = [np.linalg.norm(self.places - self.places[index], axis=1) > MOVED_M for index in (0, -1)]
        if not off[0].any():
            raise InterfaceError("the tip has not moved: there is nothing to learn")
        first, last = int(np.argmax(off[0])), len(self.times) - int(np.argmax(off[1][::-1]))
        kept = slice(max(first - 1, 0), last + 1)
        return ShownPush(self.times[kept], self.places[kept], self.contact_s)


class PushPlan(NamedTuple):
    """A planned motion of the tip.

    Attributes:
        times: Times of the m points; the first is 0 [s].
        places: Position at each time, shape (m, 2) [m].
        velocities: Velocity at each time, shape (m, 2) [m/s].
        push_s: Time at which the push begins [s].
    """

    times: Array
    places: Array
    velocities: Array
    push_s: float

    @property
    def duration_s(self) -> float:
        """Duration of the plan [s]."""
        return float(self.times[-1])

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Returns position [m] and velocity [m/s] at a time [s]. After the end: the last position and zero velocity."""
        place, velocity = (
            np.array([np.interp(time_s, self.times, column) for column in rows.T])
            for rows in (self.places, self.velocities)
        )
        return place, velocity if 0.0 <= time_s < self.duration_s else np.zeros(2)


class LearnedMotion(Protocol):
    """A motion that was learned from a demonstration."""

    def plan(self, start: Array | None = None) -> MotionPlan:
        """Returns the learned motion from a start position [m]. Default: the demonstrated start."""


Learn = Callable[[Array, Array], LearnedMotion]
"""Function that learns a motion from times [s] of shape (m,) and positions [m] of shape (m, 2)."""


def learn_dmp(times: Array, places: Array) -> LearnedMotion:
    """Learns a motion with the primitive `dmp` of the package `motion_primitives`; see `Learn`."""
    shown = Demonstration.of(times, places, names=NAMES)
    bases = min(max(MIN_BASES, round(BASES_PER_S * shown.duration_s)), MAX_BASES)
    options = {"bases": bases, "alpha": ALPHA_PER_S * max(shown.duration_s, 1.0)}
    return make_primitive("dmp", options).learn(shown)


class PushSkill:
    """Learns two primitives from a demonstration: the approach to the box, and the push.

    The approach may start anywhere and ends just before the demonstrated contact, where the push begins. A push has the
    same effect only if the tip touches the box at the demonstrated point.

    Args:
        shown: The demonstration.
        learn: Function that learns each primitive.

    Raises:
        InterfaceError: If the demonstration lacks a contact with the box, or an approach.
    """

    def __init__(self, shown: ShownPush, learn: Learn = learn_dmp) -> None:
        if shown.contact_s is None:
            raise InterfaceError("the box was not touched: there is nothing to learn")
        contact_s, shown = shown.contact_s, shown.moving()
        contact = np.array([np.interp(contact_s, shown.times, column) for column in shown.places.T])
        near = np.linalg.norm(shown.places - contact, axis=1) <= GAP_M
        split = int(np.argmax(near))
        if not near.any() or split == 0:
            raise InterfaceError(
                f"the tip was at the box from the start: begin at least {GAP_M * 100:g} cm away from it"
            )
        self._approach = learn(shown.times[: split + 1], shown.places[: split + 1])
        self._push = learn(shown.times[split:], shown.places[split:])

    def plan(self, start: Array) -> PushPlan:
        """Plans the approach from a start position [m] and the demonstrated push, and returns both as one motion."""
        approach, push = self._approach.plan(start=start), self._push.plan()
        parts: tuple[MotionPlan, MotionPlan] = approach, push
        times = np.concatenate([approach.times, approach.duration_s + push.times[1:]])
        places, velocities = (
            np.vstack([rows[0], rows[1][1:]])
            for rows in ([each.positions for each in parts], [each.velocities for each in parts])
        )
        return PushPlan(times, places, velocities, approach.duration_s)
