"""Distances between simple shapes, computed with hpp-fcl."""

from typing import Any, NamedTuple

import hppfcl
import numpy as np

from ik_ros.shape import RoundedCore

CROSSING_M = 1e-9
"""Distance between two cores up to which they count as intersecting, so that the direction is undefined [m]."""


class RobotShape(NamedTuple):
    """A shape that is attached to a link, or fixed in the base frame.

    Attributes:
        core: Size of the shape, as a core and a radius.
        link_id: Pinocchio's index of the link; None for a shape that is fixed in the base frame.
        placement: Pose of the shape in the link's frame or base frame, as a `pinocchio.SE3`.
    """

    core: RoundedCore
    link_id: int | None
    placement: Any


class Clearance(NamedTuple):
    """Distance between two shapes.

    Attributes:
        distance: Distance between the surfaces; negative if the shapes penetrate each other [m].
        direction: Unit vector from the first shape to the second, in the base frame.
        first: Point of the first shape's core that is nearest to the second core, in the base frame [m].
        second: Point of the second shape's core that is nearest to the first core, in the base frame [m].
    """

    distance: float
    direction: np.ndarray
    first: np.ndarray
    second: np.ndarray


def clearance(first: RoundedCore, place: Any, second: RoundedCore, other: Any) -> Clearance:
    """Measures the distance between two shapes.

    The result is the distance between the cores minus the radii, since hpp-fcl does not return a direction for round
    shapes that penetrate each other.

    Args:
        first: The first shape.
        place: Pose of the first shape in the base frame, a `pinocchio.SE3`.
        second: The second shape.
        other: Pose of the second shape in the base frame, a `pinocchio.SE3`.
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
    """Converts a core to an hpp-fcl shape: a box, or a capsule of radius 0 for a line or point."""
    return hppfcl.Box(2.0 * core.half) if core.is_box else hppfcl.Capsule(0.0, 2.0 * core.half[2])
