"""The task `com_in_support`: keeps the centre of mass over the support polygon, for balance."""

from collections.abc import Iterable, Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import KeyedError, ListOf, NonNegative, Position

from .robot import PinocchioRobot
from .task import Linearization, Task, TaskConfig, keyed_errors


class ComInSupportConfig(TaskConfig):
    """Options of the task `com_in_support`.

    Attributes:
        support: Contact points with the ground, such as the corners of both soles. Positions are in the frame of the
            link, indexed by link name [m].
        margin: Smallest distance of the centre of mass from the edges of the support polygon [m].
    """

    support: dict[str, ListOf[Position]] = Field(min_length=1)
    margin: NonNegative = 0.0


class ComInSupport(Task):
    """Keeps the centre of mass over the support polygon, in the base frame's x-y plane, which must be horizontal.

    The polygon is the convex hull of the contact points' current positions. The Jacobian ignores the motion of the
    contact points, since other constraints should hold the feet that stand on the ground.
    """

    Config = ComInSupportConfig

    def __init__(self, config: ComInSupportConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot)
        self._margin = config.margin
        with keyed_errors("support"):
            self._contacts = [(robot.link_id(link), np.array(points)) for link, points in config.support.items()]
        if sum(len(points) for _, points in self._contacts) < 3:
            raise KeyedError("support", "expected 3 points at least")

    def rows(self, q: np.ndarray) -> Linearization:
        """Returns the distance of the centre of mass from each edge of the polygon, negative inside [m]; see `Task`."""
        com, jacobian = self.robot.com(q)
        corners = self.polygon()
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.linalg.norm(edges, axis=1)
        kept = lengths > 1e-9
        outward = np.stack((edges[kept, 1], -edges[kept, 0]), axis=1) / lengths[kept, None]
        values = np.einsum("ij,ij->i", outward, com[:2] - corners[kept])
        upper = np.full(len(values), -self._margin)
        return Linearization(values, outward @ jacobian[:2], np.full(len(values), -np.inf), upper)

    def polygon(self) -> np.ndarray:
        """Returns the k corners x, y of the support polygon in the base frame, counter-clockwise, k x 2 [m]."""
        points = [self.robot.frame(link).act(point) for link, points in self._contacts for point in points]
        return np.array(_hull((float(x), float(y)) for x, y, _ in points))


def _hull(points: Iterable[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    """Returns the corners of the points' convex hull, counter-clockwise.

    Source: Andrew, Another efficient algorithm for convex hulls in two dimensions, Information Processing Letters 9(5),
    1979.
    """
    ordered = sorted(set(points))
    lower, upper = _half_hull(ordered), _half_hull(ordered[::-1])
    return lower[:-1] + upper[:-1]


def _half_hull(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    kept: list[tuple[float, float]] = []
    for x, y in points:
        while len(kept) > 1:
            (x0, y0), (x1, y1) = kept[-2:]
            if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0.0:
                break
            kept.pop()
        kept.append((x, y))
    return kept
