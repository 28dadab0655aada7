"""Visual robots, which are shown at their joint targets and TF poses, without contacts."""

from collections.abc import Mapping
from typing import Any

from rpbi.control.joint_command import JointCommand
from rpbi.control.motors import LimitReports
from rpbi.engine.client import Client
from rpbi.engine.inputs import Input

from .jointed import JointedBody
from .robot_config import RobotConfig


class VisualRobot(JointedBody):
    """A robot without physics, which moves to its targets at once and has no contacts."""

    has_physics = False
    fixes_base = True
    example = {
        "is_visual_robot": True,
        "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
        "broadcast_link_states": True,
        "start_ik_callback": True,
        "object_tf": {"tf_id": "FRAME"},
    }

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        super().__init__(pb, config)
        self.object_tf = config.object_tf
        self._limit_reports = LimitReports(self.name)
        for link in (-1, *self.joint_indices):
            pb.setCollisionFilterGroupMask(self.body_id, link, 0, 0)
            # a body without mass does not fall; without inertia, spherical joints would become non-finite
            pb.changeDynamics(self.body_id, link, mass=0.0, localInertiaDiagonal=(1.0, 1.0, 1.0))

    @classmethod
    def claims(cls, data: Mapping[str, Any]) -> bool:
        """Returns whether a YAML object of the section `robots` is a visual robot."""
        return data.get("is_visual_robot") in (True, 1)

    def inputs(self) -> Mapping[str, Input]:
        """Returns the inputs of the robot, indexed by name.

        The inputs are `target` and, if the base follows a TF frame, `pose`. A value of `target` is a JointCommand or a
        mapping from joint names to positions [rad or m].
        """
        return {**super().inputs(), "target": Input(self._check_target, self._show, merge=dict.__or__)}

    def _check_target(self, given: JointCommand | Mapping[str, float]) -> dict[int, float]:
        target = JointCommand.of(given, "position")
        return self.model.resolve(target.names, target.values_of("position", "a visual robot shows positions"))

    def _show(self, positions: dict[int, float]) -> None:
        positions = self.model.with_mimic_joints(positions)
        self._put_joints(positions)
        if self.config.do_log_joint_limit_violations:
            for index, position in positions.items():
                self._limit_reports.observe(self.joints[index], position, "it is shown there")
