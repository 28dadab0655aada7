"""What every body in the world has in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from custom_ros_tools.errors import PhysicsError
from custom_ros_tools.schema import ConfigModel

from ..client import Client
from ..inputs import Input
from ..pose import Pose
from ..samples import BodyState
from ..sensors.sensor import Sensor


class Body:
    """A body in one PyBullet client.

    A new type is a subclass with a `Config` and an `__init__` that creates the body and hands its id on; the rest may
    stay as it is. Whatever PyBullet created when `__init__` raises is removed by the caller.

    Args:
        pb: The client that the body lives in.
        name: Unique name of the body.
        body_id: PyBullet's id of it, valid as long as it exists.
    """

    Config: ClassVar[type[ConfigModel]]
    section: ClassVar[str]
    """The list of the main YAML file that names objects of this type."""

    def __init__(self, pb: Client, name: str, body_id: int) -> None:
        if body_id < 0:
            raise PhysicsError(f"{name}: PyBullet did not create the body")
        self.pb = pb
        self.name = name
        self.body_id = body_id
        self.joint_indices = tuple(range(pb.getNumJoints(body_id)))
        inertial = pb.getDynamicsInfo(body_id, -1)
        self.inertial_pose_in_base = Pose(inertial[3], inertial[4])
        self._base_pose_in_inertial = self.inertial_pose_in_base.inverse()

    def before_step(self, tick: int) -> None:
        """Acts just before the physics of each tick; bodies that need nothing leave it."""

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the sensors that the body carries."""
        return ()

    def inputs(self) -> Mapping[str, Input]:
        """Returns what the body takes while the world runs, by name."""
        return {}

    def base_pose(self) -> Pose:
        """Returns the pose of the base link's URDF frame in the world."""
        return Pose(*self.pb.getBasePositionAndOrientation(self.body_id)) @ self._base_pose_in_inertial

    def set_base_pose(self, pose: Pose) -> None:
        """Puts the base link's URDF frame at a pose in the world and leaves the velocity as it is."""
        self.pb.resetBasePositionAndOrientation(self.body_id, *(pose @ self.inertial_pose_in_base))

    def state(self) -> BodyState:
        """Returns where the body is."""
        position, quat = self.pb.getBasePositionAndOrientation(self.body_id)
        joints = self.pb.getJointStates(self.body_id, self.joint_indices) if self.joint_indices else ()
        return BodyState(self.name, position + quat, tuple(joint[0] for joint in joints))

    def remove(self) -> None:
        """Takes the body out of the world."""
        self.pb.removeBody(self.body_id)
