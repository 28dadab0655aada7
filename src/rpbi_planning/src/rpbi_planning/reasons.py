"""Says why there is no plan: joints outside limits, violated constraints, shapes that touch or nearly touch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from safe_robot.check import MarginViolation
from safe_robot.commands.escape import find_escape
from safe_robot.limits import MotionLimits

from .collision import CollisionModel, Meeting
from .constraints import BoundConstraint
from .group import Group

Array = np.ndarray
OUTSIDE = 1e-3
"""Distance beyond a limit up to which a start is moved to the limit [rad or m]; measured positions are noisy."""
NAMED = 3
"""Largest number of pairs of shapes that are named."""


def outside_limits(group: Group, start: Array) -> str:
    """Names the joint that is farthest outside its limits; empty if all are inside, up to `OUTSIDE`."""
    outside = np.maximum(group.lower - start, start - group.upper)
    i = int(np.argmax(outside))
    if outside[i] <= OUTSIDE:
        return ""
    limits = f"{group.lower[i]:g} to {group.upper[i]:g}"
    return f"the start is outside the limits of joint '{group.joint_names[i]}': {start[i]:g}, limits {limits}"


def violated_constraint(bound: Sequence[BoundConstraint], q: Array) -> str:
    """Names the constraint that is violated most; empty if none is."""
    if not bound:
        return ""
    worst = min(bound, key=lambda each: float(each.margins(q[None])[0]))
    margin = float(worst.margins(q[None])[0])
    if margin >= 0.0:
        return ""
    return f"{type(worst.constraint).__name__} of link '{worst.constraint.link}' misses by {-margin:.3g}"


def near_at_start(model: CollisionModel, start: Array) -> str:
    """Names shapes that are nearer than the padding at the start; empty if there are none."""
    if not model.is_lowered:
        return ""
    distances = model.distances(start)
    pairs = [
        f"'{a}' and '{b}' are {1e3 * distances[i]:.2f} mm apart"
        for i in np.argsort(distances)[:NAMED].tolist()
        for a, b in [(model.shapes[model.first[i]].name, model.shapes[model.second[i]].name)]
    ]
    return f"; at the start, {', '.join(pairs)}"


def meetings_of(model: CollisionModel, q: Array) -> str:
    """Names the pairs of shapes that are in collision, the deepest first."""
    meetings = model.meetings(q)
    more = f"; and {len(meetings) - NAMED} more" if len(meetings) > NAMED else ""
    return "; ".join(map(str, meetings[:NAMED])) + more


def way_out(model: CollisionModel, q: Array) -> str:
    """Returns the pairs of shapes that are in collision, and the motion of the joints that separates them."""
    words, group = meetings_of(model, q), model.group
    limits = MotionLimits(group.lower, group.upper, group.velocity, group.acceleration, group.jerk)
    way = find_escape(q, limits, lambda at: _inside(model, at))
    if way is None or way.direction is None:
        return f"{words}; no motion of the joints separates all of them"
    moves = ", ".join(
        f"{name} {speed:+.2f}" for name, speed in zip(group.joint_names, way.direction) if abs(speed) > 0.005
    )
    return f"{words}; this motion of the joints leads out: {moves}"


def _inside(model: CollisionModel, q: Array) -> list[MarginViolation]:
    distances = model.distances(q)
    found = []
    for i in np.flatnonzero(distances < model.padding).tolist():
        steps = np.array([model.distances(q + 1e-4 * row, [i])[0] for row in np.eye(len(q))])
        a, b = (model.shapes[each[i]].name for each in (model.first, model.second))
        subject = str(Meeting(a, b, float(distances[i]), float(model.padding[i])))
        gradient = (steps - distances[i]) / 1e-4
        found.append(
            MarginViolation("planning", (a, b), subject, float(distances[i]), float(model.padding[i]), gradient)
        )
    return found
