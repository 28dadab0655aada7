"""Check that the origins of links stay within boxes."""

import math
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from custom_ros_tools.schema import ConfigModel, KeyedError
from robot_model.model import RobotModel
from safe_robot.check import Check, CheckConfig, CheckContext, Violation
from safe_robot.limits import MotionLimits
from safe_robot.motion import Bound, CommandedMotion

STEP = 1e-6
"""Joint displacement for numerical derivatives of link positions [rad or m]."""
SPARE_M = 1e-4
"""Distance that the search for a safe command keeps from the faces of a box [m]."""


class BoxConfig(ConfigModel):
    """A box, given in the frame of the robot's root link. An axis without limits may be left out."""

    x: tuple[float | None, float | None] = Field(
        (None, None), strict=False, description="Least and largest x of the link's origin [m]; null is no limit."
    )
    y: tuple[float | None, float | None] = Field(
        (None, None), strict=False, description="Least and largest y of the link's origin [m]; null is no limit."
    )
    z: tuple[float | None, float | None] = Field(
        (None, None), strict=False, description="Least and largest z of the link's origin [m]; null is no limit."
    )

    @model_validator(mode="after")
    def _in_order(self) -> "BoxConfig":
        for key in "xyz":
            low, high = getattr(self, key)
            if low is not None and high is not None and low >= high:
                raise KeyedError(key, f"expected the least value first, got {low:g} and {high:g}")
        return self


class LinkBoxConfig(CheckConfig):
    """Boxes that the origins of links must not leave."""

    boxes: dict[str, BoxConfig] = Field(
        {}, description="Boxes that the origins of links must not leave, keyed by link name."
    )


class Box(NamedTuple):
    """Box that the origin of a link must not leave.

    Attributes:
        low: Smallest x, y and z in the frame of the robot's root link, shape (3,) [m].
        high: Largest x, y and z in the same frame, shape (3,) [m].
        reach: Upper bound of the link origin's displacement per unit of motion of each joint, shape (n,) [m/rad or 1].
    """

    low: np.ndarray
    high: np.ndarray
    reach: np.ndarray


class LinkBox(Check):
    """Checks that the origins of links stay within boxes, also while the robot brakes."""

    Config = LinkBoxConfig
    name = "link_box"

    def __init__(self, config: Any, robot: RobotModel, limits: MotionLimits, file: str) -> None:
        super().__init__(config, robot, limits, file)
        self._boxes: dict[str, Box] = {}
        self._room: dict[str, tuple[np.ndarray, float]] = {}  # last n positions, and distance to the faces there
        for link, box in config.boxes.items():
            self.require_link(link, "boxes")
            low = [-math.inf if axis[0] is None else axis[0] for axis in (box.x, box.y, box.z)]
            high = [math.inf if axis[1] is None else axis[1] for axis in (box.x, box.y, box.z)]
            self._boxes[link] = Box(np.array(low), np.array(high), robot.reach(link, 0.0))

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        for link, (low, high, reach) in self._boxes.items():
            if link in self._room:
                place, room = self._room[link]
                if (np.abs(motion.with_start - place) @ reach).max() < room:  # the motion is too short to leave the box
                    continue
            position = motion.link_positions(link)
            self._room[link] = motion.start.position, float(np.minimum(position[0] - low, high - position[0]).min())
            before = position[0]
            is_inside = (position >= np.minimum(low, before)) & (position <= np.maximum(high, before))
            if not is_inside.all():
                row, axis = divmod(int(np.argmin(is_inside)), 3)
                value = float(position[row, axis])
                limit = float(low[axis] if value < low[axis] else high[axis])
                return Violation(self.name, f"{'xyz'[axis]} of link '{link}'", value, limit, "m", row > 1)
        return None

    def bounds(self, rows: np.ndarray, spread: np.ndarray, before: np.ndarray) -> list[Bound]:
        """See `Check`."""
        bounds = []
        k, n = rows.shape
        tried = np.concatenate((before[None], rows, (rows[:, None] + STEP * np.eye(n)).reshape(-1, n)))
        for link, (low, high, _) in self._boxes.items():
            position = self.robot.frames.positions(tried, link)
            at = position[1 : k + 1]
            slopes = (position[k + 1 :].reshape(k, n, 3) - at[:, None]).transpose(0, 2, 1) / STEP  # k x 3 x n
            low, high = np.minimum(low + SPARE_M, position[0]), np.maximum(high - SPARE_M, position[0])
            for slope, room in ((slopes, at - low), (-slopes, high - at)):
                near = np.argwhere(np.abs(slope) @ spread > room)
                bounds += [Bound(row, slope[row, axis], float(room[row, axis])) for row, axis in near.tolist()]
        return bounds
