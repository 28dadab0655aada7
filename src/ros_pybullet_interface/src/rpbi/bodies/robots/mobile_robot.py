"""Mobile robots, whose base drives over the ground."""

from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.control.planar_base import PLANAR_JOINTS, PlanarBase, PlanarVelocity, with_planar_joints
from rpbi.engine.client import Client
from rpbi.engine.inputs import Input
from rpbi.geometry import Pose, Twist, rotated

from .robot import Robot
from .robot_config import RobotConfig


class MobileRobot(Robot):
    """A robot whose base follows velocity commands in the x-y plane of the base's start pose.

    Additional joints between the world and the root link move the base. These joints do not appear in the robot's joint
    states and targets.
    """

    base_joints = len(PLANAR_JOINTS)
    fixes_base = True
    prepare_urdf = staticmethod(with_planar_joints)
    example = {key: value for key, value in Robot.example.items() if key != "object_tf"} | {"planar_base": {}}

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        if config.planar_base is None:  # the YAML names the type mobile_robot
            raise ConfigError([Problem(config.name, "planar_base", "missing: a mobile_robot needs it")])
        super().__init__(pb, config)
        self.planar_base = PlanarBase(pb, self.body_id, config.planar_base, self.drive.dt_s)

    @classmethod
    def claims(cls, data: Mapping[str, Any]) -> bool:
        """Returns whether a YAML object of the section `robots` is a robot whose base drives."""
        return data.get("planar_base") is not None

    def inputs(self) -> Mapping[str, Input]:
        """Returns the inputs of a `Robot`, and `cmd_vel`, a twist in the base frame [m/s, rad/s]."""
        return {**super().inputs(), "cmd_vel": Input(PlanarVelocity.checked, self.planar_base.follow)}

    def restart(self) -> bool:
        """Returns False, so that a reset creates the robot anew."""
        return False

    def before_step(self, tick: int) -> None:
        """Advances motion and controllers as `Robot` does, and drives the base."""
        super().before_step(tick)
        self.planar_base.before_step(tick)

    def base_pose(self) -> Pose:
        """Returns the pose of the root link's URDF frame in the world frame."""
        return super().base_pose() @ self.planar_base.pose_in_plane()

    def base_twist(self) -> Twist:
        """Returns the twist of the root link's URDF frame, in the axes of the world frame."""
        plane = super().base_pose().quat_xyzw
        x, y, yaw = self.planar_base.velocity_in_plane()
        return Twist(rotated(plane, (x, y, 0.0)), rotated(plane, (0.0, 0.0, yaw)))

    def set_base_pose(self, pose: Pose) -> None:
        """Moves the root link's URDF frame to a pose in the world frame, and stops the base's motion.

        From then on, the base drives in the x-y plane of that pose.
        """
        super().set_base_pose(pose)
        for index in PLANAR_JOINTS:
            self.pb.resetJointState(self.body_id, index, 0.0)
        self.planar_base.rest()
