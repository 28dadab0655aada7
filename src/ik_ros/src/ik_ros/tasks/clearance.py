"""Distances between simple shapes, by hpp-fcl."""

from typing import Any, NamedTuple

import hppfcl
import numpy as np

from ik_ros.shape import RoundedCore

CROSSING_M = 1e-9
"""Distance between two lines below which they have no direction [m]."""


class RobotShape(NamedTuple):
    """A shape at a link, or in the base.

    Attributes:
        core: The shape.
        link_id: Pinocchio's index of its link; None: it is fixed in the base.
        placement: Its pose in the link or base, a `pinocchio.SE3`.
    """

    core: RoundedCore
    link_id: int | None
    placement: Any


class Clearance(NamedTuple):
    """Distance between two shapes.

    Attributes:
        distance: Distance between the surfaces [m]; negative if they penetrate.
        direction: Unit vector from the first to the second, in the base.
        first: Nearest point of the first shape, fixed to that shape, in the base [m].
        second: The same for the second shape.
    """

    distance: float
    direction: np.ndarray
    first: np.ndarray
    second: np.ndarray


def clearance(first: RoundedCore, place: Any, second: RoundedCore, other: Any) -> Clearance:
    """Returns the distance of two shapes with their places in the base, each a `pinocchio.SE3`.

    It is measured between cores, since hpp-fcl returns no direction for round shapes that penetrate.
    """
    result = hppfcl.DistanceResult()
    places = (hppfcl.Transform3f(each.rotation, each.translation) for each in (place, other))
    (here, there), request = places, hppfcl.DistanceRequest(True)
    distance = hppfcl.distance(_core(first), here, _core(second), there, request, result)
    ends = result.getNearestPoint1(), result.getNearestPoint2()
    if abs(distance) > CROSSING_M:
        direction = (ends[1] - ends[0]) / distance
    else:  # the cores intersect
        direction, ends = place.rotation[:, 0], (place.translation, place.translation)
    return Clearance(distance - first.radius - second.radius, direction, *ends)


def _core(core: RoundedCore) -> Any:
    """Returns a box, or a line or point as a capsule of radius 0."""
    return hppfcl.Box(2.0 * core.half) if core.is_box else hppfcl.Capsule(0.0, 2.0 * core.half[2])
