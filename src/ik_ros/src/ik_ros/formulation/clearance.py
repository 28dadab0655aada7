"""Distances between simple shapes."""

from typing import Any, NamedTuple

import numpy as np

from ik_ros.shape import Core

ROUNDS = 6
"""How often the place on a line that is nearest to a box is narrowed down, to an eighth each time."""
PARTS = np.linspace(0.0, 1.0, 17)


class Placed(NamedTuple):
    """A shape in the base.

    Attributes:
        core: The shape.
        rotation: How it is turned, 3 x 3.
        position: Where it is [m].
    """

    core: Core
    rotation: np.ndarray
    position: np.ndarray

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Both ends of its line [m]; the same for a point."""
        along = self.rotation[:, 2] * self.core.half[2]
        return self.position - along, self.position + along


class Clearance(NamedTuple):
    """How far two shapes are apart.

    Attributes:
        distance: Between the surfaces; negative if they are in each other [m].
        direction: Unit vector from the first to the second, in the base.
        first: Where the first is nearest: a point that is fixed to it, in the base [m].
        second: The same for the second.
    """

    distance: float
    direction: np.ndarray
    first: np.ndarray
    second: np.ndarray


def clearance(first: Placed, second: Placed) -> Clearance:
    """Returns how far two shapes are apart; one of them at most is a box, and the way out of it is that of a point."""
    rounding = first.core.radius + second.core.radius
    if first.core.is_box:
        found = clearance(second, first)
        return Clearance(found.distance, -found.direction, found.second, found.first)
    if second.core.is_box:
        point, signed, outward = _line_and_box(first, second)
        return Clearance(signed - rounding, -outward, point, point - signed * outward)
    a, b = _lines(*first.ends, *second.ends)
    way = b - a
    distance = float(np.linalg.norm(way))
    if distance < 1e-9:  # they cross: apart is across both
        across = np.cross(first.rotation[:, 2], second.rotation[:, 2])
        length = np.linalg.norm(across)
        direction = across / length if length > 1e-9 else first.rotation[:, 0]
    else:
        direction = way / distance
    return Clearance(distance - rounding, direction, a, b)


def _lines(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the points of two lines that are nearest to each other.

    After Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    u, v, w = a1 - a0, b1 - b0, a0 - b0
    uu, vv, uv, uw, vw = u @ u, v @ v, u @ v, u @ w, v @ w
    if uu < 1e-12:
        s, t = 0.0, _part(vw, vv)
    elif vv < 1e-12:
        s, t = _part(-uw, uu), 0.0
    else:
        determinant = uu * vv - uv * uv
        s = _part(uv * vw - uw * vv, determinant) if determinant > 1e-12 * uu * vv else 0.0
        t = (uv * s + vw) / vv
        if not 0.0 <= t <= 1.0:
            t = min(max(t, 0.0), 1.0)
            s = _part(uv * t - uw, uu)
    return a0 + s * u, b0 + t * v


def _part(way: float, length: float) -> float:
    return min(max(way / length, 0.0), 1.0) if length > 1e-12 else 0.0


def _line_and_box(line: Placed, box: Placed) -> tuple[np.ndarray, float, np.ndarray]:
    """Returns the point of a line that is nearest to a box, or deepest in it, how far, and which way is out."""
    ends = line.ends
    start, end = ((point - box.position) @ box.rotation for point in ends)
    low, high = 0.0, 1.0
    best = 0.0
    for _ in range(ROUNDS if line.core.half[2] else 0):  # the signed distance of a convex shape is convex
        parts = low + (high - low) * PARTS
        over = np.abs(start + np.outer(parts, end - start)) - box.core.half
        signed = np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0)
        i = int(signed.argmin())
        best, low, high = parts[i], parts[max(i - 1, 0)], parts[min(i + 1, len(parts) - 1)]
    point = start + best * (end - start)
    over = np.abs(point) - box.core.half
    if (over > 0.0).any():
        outside = np.maximum(over, 0.0)
        length = float(np.linalg.norm(outside))
        outward, distance = np.sign(point) * outside / length, length
    else:
        nearest = int(over.argmax())
        outward, distance = np.zeros(3), float(over[nearest])
        outward[nearest] = 1.0 if point[nearest] >= 0.0 else -1.0
    return ends[0] + best * (ends[1] - ends[0]), distance, box.rotation @ outward


class RobotShape(NamedTuple):
    """A shape at a link, or in the base.

    Attributes:
        core: The shape.
        link_id: Pinocchio's number of its link; None: it stands in the base.
        placement: Where it is in the link or base, a `pinocchio.SE3`.
    """

    core: Core
    link_id: int | None
    placement: Any
