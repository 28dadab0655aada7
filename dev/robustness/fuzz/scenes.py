"""The robots that receive hostile targets, their surroundings, and their guards."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet_data

from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Vector
from robot_model.model import RobotModel
from rpbi.geometry import Pose
from safe_robot.check import CheckContext
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

LWR = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
PERIOD_S = 0.01
LIMITS = {"velocity": 1.0, "acceleration": 8.0, "jerk": 200.0}
MARGIN_M = 0.02


class Scene(NamedTuple):
    """A robot and boxes around it.

    Attributes:
        urdf: Its description; meshes are in the same folder.
        home: n positions from where nothing is near [rad].
        boxes: Extents and places of boxes in the robot's root [m].
    """

    urdf: Path
    home: np.ndarray
    boxes: Mapping[str, tuple[Vector, Vector]]

    @property
    def around(self) -> CheckContext:
        """The boxes, as a guard gets them."""
        return CheckContext(
            obstacles=tuple(Obstacle(name, "box", size, Pose(place)) for name, (size, place) in self.boxes.items())
        )

    def guard(
        self,
        policy: str,
        around: bool = True,
        shape: bool = False,
        geometry: str = "hulls",
        margin_m: float = MARGIN_M,
        **changes: float,
    ) -> Guard:
        """Returns a started guard, with all checks of joints and, unless `around` is off, of shapes.

        Args:
            policy: `reject` or `limit`.
            around: Whether shapes are checked.
            shape: Whether targets are smoothed.
            geometry: `hulls` or `exact`.
            margin_m: The margin [m].
            changes: Limits other than `LIMITS`, which makes it a bad one.
        """
        shapes = {"margin_m": margin_m, "active": around, "geometry": geometry}
        options: dict[str, Any] = {
            "policy": policy,
            "period_s": PERIOD_S,
            "start_from": "target",
            "limits": {**LIMITS, **changes},
            "checks": {"environment": shapes, "self_collision": shapes},
            "shape": {"time_s": 0.03} if shape else None,
        }
        guard = Guard(GuardConfig.parse(options, "fuzz"), RobotModel(str(self.urdf)), "fuzz")
        guard.start()
        return guard


SCENES = {
    "two": Scene(
        Path(__file__).with_name("two_joints.urdf"),
        np.zeros(2),
        {"table": ((0.6, 1.0, 0.04), (0.5, 0.0, -0.35)), "pole": ((0.08, 0.08, 1.2), (0.3, 0.62, 0.0))},
    ),
    "seven": Scene(
        Path(pybullet_data.getDataPath()) / "kuka_iiwa/model.urdf",
        np.array((0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)),
        {"table": ((0.7, 1.2, 0.1), (0.7, 0.0, 0.05)), "pole": ((0.08, 0.08, 1.2), (0.3, 0.5, 0.6))},
    ),
    "lwr": Scene(LWR, np.array((0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)), {"table": ((0.7, 1.2, 0.1), (0.7, 0.0, 0.05))}),
}
"""By number of joints; the second one has meshes. And an arm of cylinders."""
