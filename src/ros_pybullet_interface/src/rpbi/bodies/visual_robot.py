"""Visual robots: shown where joint targets and TF say, felt by nobody."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from ..client import Client
from ..inputs import Input
from ..joint_model import JointTarget
from .jointed import JointedBody
from .robot_config import RobotConfig

log = logging.getLogger(__name__)


class VisualRobot(JointedBody):
    """A robot without physics: it is put where it shall be, pushes nothing and is pushed by nothing.

    Raises:
        ConfigError: If the configuration does not fit the robot.
        PhysicsError: If PyBullet cannot load it.
    """

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        super().__init__(pb, config, fixed_base=True)
        self._beyond: dict[int, bool] = {}
        for link in (-1, *self.joint_indices):
            pb.setCollisionFilterGroupMask(self.body_id, link, 0, 0)
            pb.changeDynamics(self.body_id, link, mass=0.0)  # what has no mass does not fall

    @classmethod
    def claims(cls, data: Mapping[str, Any]) -> bool:
        """Tells whether a YAML of the section `robots` is that of a visual robot."""
        return data.get("is_visual_robot") in (True, 1)

    def inputs(self) -> Mapping[str, Input]:
        """Takes `target`, a JointTarget of positions [rad or m], beside the pose of its base."""
        return {**super().inputs(), "target": Input(self._check_target, self._show, merge=dict.__or__)}

    def _check_target(self, target: JointTarget) -> dict[int, float]:
        return self.model.resolve(target.names, target.values_of("position", "a visual robot shows positions"))

    def _show(self, positions: dict[int, float]) -> None:
        for index, position in positions.items():
            self.pb.resetJointState(self.body_id, index, position)
        if self.config.do_log_joint_limit_violations:
            self._report_violations(positions)

    def _report_violations(self, positions: dict[int, float]) -> None:
        """Names each joint that has just gone beyond its limits, once until it has come back."""
        for index, position in positions.items():
            joint = self.joints[index]
            beyond = not joint.allows(position)
            if beyond and not self._beyond.get(index):
                log.warning("%s: %s", self.name, joint.limit_violation(position))
            self._beyond[index] = beyond
