"""The task `distance`: keeps links away from each other and from obstacles."""

from typing import Any

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import KeyedError, ListOf, NonNegative, Text

from .clearance import RobotShape, clearance
from .robot import PinocchioRobot
from .task import Linearization, Task, TaskConfig, keyed_errors

NEAR_M = 0.3
"""Distance beyond the required distance from which a pair of shapes is ignored [m]."""


class DistanceConfig(TaskConfig):
    """Options of the task `distance`.

    Attributes:
        pairs: Names of the two shapes of each pair.
        at_least: Smallest allowed distance between the two shapes of each pair [m].
    """

    pairs: ListOf[ListOf[Text]] = Field(min_length=1)
    at_least: NonNegative = 0.0


class Distance(Task):
    """Keeps the two shapes of each pair apart. A pair is two shapes on links, or a shape on a link and an obstacle."""

    Config = DistanceConfig

    def __init__(self, config: DistanceConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot)
        self._at_least = config.at_least
        self._pairs: list[tuple[RobotShape, RobotShape]] = []
        for i, pair in enumerate(config.pairs):
            key = f"pairs[{i}]"
            if len(pair) != 2:
                raise KeyedError(key, f"expected two shapes, got {len(pair)}")
            with keyed_errors(key):
                first, second = (robot.shape(name) for name in pair)
            if first.link_id == second.link_id:
                raise KeyedError(key, f"'{pair[0]}' and '{pair[1]}' are on the same link, or both are fixed")
            self._pairs.append((first, second))

    def rows(self, q: np.ndarray) -> Linearization:
        """Returns the distance between the shapes of each pair [m], without pairs that are far apart; see `Task`."""
        values, rows = [], []
        for first, second in self._pairs:
            found = clearance(first.core, self._place(first), second.core, self._place(second))
            if found.distance < self._at_least + NEAR_M:
                values.append(found.distance)
                way = found.direction
                rows.append(self._along(second, found.second, way) - self._along(first, found.first, way))
        count = len(values)
        jacobian = np.array(rows) if rows else np.zeros((0, len(self.robot.free)))
        return Linearization(np.array(values), jacobian, np.full(count, self._at_least), np.full(count, np.inf))

    def _place(self, shape: RobotShape) -> Any:
        return shape.placement if shape.link_id is None else self.robot.frame(shape.link_id) * shape.placement

    def _along(self, shape: RobotShape, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Returns the derivatives of a point's coordinate along `direction` with respect to the m free components.

        The free components are those of a velocity that the solver determines, see `PinocchioRobot.free`.

        Args:
            shape: The shape that the point is fixed to.
            point: Position of the point in the base frame [m].
            direction: Unit vector in the base frame.
        """
        if shape.link_id is None:
            return np.zeros(len(self.robot.free))
        frame = self.robot.frame(shape.link_id)
        jacobian = self.robot.jacobian(shape.link_id)
        along = frame.rotation.T @ direction
        return along @ jacobian[:3] + np.cross(frame.actInv(point), along) @ jacobian[3:]
