"""The joints between a robot's base and one of its links, as PyBullet moves them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robot_model.geometry import Quaternion, rotation_between
from robot_model.reach import Reach, Residual
from robot_model.urdf.files import write_description
from rpbi.engine.client import Client
from rpbi.geometry import Pose
from rpbi.urdf.joints import Joint


class Target(NamedTuple):
    """Target of a link.

    Attributes:
        position: x, y, z in the base [m].
        quat_xyzw: Its orientation in the base, a unit quaternion; None: any.
    """

    position: Sequence[float]
    quat_xyzw: Quaternion | None


class BulletChain:
    """A link and the m joints that move it, as a body of its own, since further joints would cost time.

    Args:
        urdf: The part between the root and the link, see `UrdfDocument.bare`.
        scaling: PyBullet's `globalScaling`.
        joint_names: The n joints of the robot that a motor can move.

    Attributes:
        members: Indices of the m joints among the n.
        reach: Largest distance of the link from the root [m].
    """

    def __init__(self, pb: Client, urdf: str, scaling: float, link_name: str, joint_names: Sequence[str]) -> None:
        self.pb = pb
        self.body_id: int = pb.loadURDF(write_description(urdf), useFixedBase=True, globalScaling=scaling)
        joints = Joint.all_of(pb, self.body_id)
        self.link_index = next(joint.index for joint in joints if joint.link == link_name)
        driven = [joint for joint in joints if joint.is_driven]
        self._joint_indices = [joint.index for joint in driven]
        self.members = [joint_names.index(joint.name) for joint in driven]
        self.set(np.zeros(len(driven)))
        knots = [
            pb.getLinkState(self.body_id, index, computeForwardKinematics=True)[4]
            for index in (*self._joint_indices, self.link_index)
        ]
        self.reach = Reach.of(knots[0], map(math.dist, knots, knots[1:]), driven)

    def set(self, q: np.ndarray) -> None:
        """Puts the joints at m positions [rad or m]."""
        if self._joint_indices:
            self.pb.resetJointStatesMultiDof(self.body_id, self._joint_indices, [[position] for position in q.tolist()])

    def pose(self) -> Pose:
        """Returns the pose of the link in the base."""
        state = self.pb.getLinkState(self.body_id, self.link_index, computeForwardKinematics=True)
        return Pose(state[4], state[5])

    def error(self, target: Target) -> np.ndarray:
        """Returns the error to the target: 3 distances [m], and a rotation vector [rad] if it has an orientation."""
        position, quat = self.pose()
        error = [goal - present for goal, present in zip(target.position, position)]
        if target.quat_xyzw is not None:
            error += rotation_between(quat, target.quat_xyzw)
        return np.array(error)

    def residual(self, target: Target, q: np.ndarray) -> Residual:
        """Returns the residual of the link at m positions [rad or m]."""
        self.set(q)
        error = self.error(target).tolist()
        return Residual(math.hypot(*error[:3]), math.hypot(*error[3:]))

    def jacobian(self, q: np.ndarray, rows: int) -> np.ndarray:
        """Returns how the link's position, and with 6 rows its orientation, changes with the joints, rows x m."""
        zeros = [0.0] * len(q)
        linear, angular = self.pb.calculateJacobian(
            self.body_id, self.link_index, [0.0, 0.0, 0.0], q.tolist(), zeros, zeros
        )
        return np.array(linear if rows == 3 else linear + angular)
