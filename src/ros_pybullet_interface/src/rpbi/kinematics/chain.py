"""Kinematic chain from a robot's base to one of its links, computed by PyBullet."""

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
    """Target position of a link, and optionally a target orientation.

    Attributes:
        position: Position x, y, z in the frame of the base [m].
        quat_xyzw: Orientation in the frame of the base, a unit quaternion; None accepts any orientation.
    """

    position: Sequence[float]
    quat_xyzw: Quaternion | None


class BulletChain:
    """Computes the kinematics of one link, which m joints move.

    Loads the chain from the root to the link as a separate PyBullet body, because further joints would cost time.

    Args:
        pb: Client into which the chain is loaded.
        urdf: URDF of the chain, without shapes.
        scaling: PyBullet's `globalScaling`.
        link_name: Name of the link.
        joint_names: Names of the robot's n joints that motors can move.

    Attributes:
        members: Indices of the m joints in `joint_names`.
        reach: Ball that contains all positions of the link's origin, in the frame of the base.
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
        """Sets the positions [rad or m] of the m joints."""
        if self._joint_indices:
            self.pb.resetJointStatesMultiDof(self.body_id, self._joint_indices, [[position] for position in q.tolist()])

    def pose(self) -> Pose:
        """Returns the pose of the link's URDF frame in the frame of the base."""
        state = self.pb.getLinkState(self.body_id, self.link_index, computeForwardKinematics=True)
        return Pose(state[4], state[5])

    def error(self, target: Target) -> np.ndarray:
        """Returns the error from the link's present pose to a target, in the axes of the base.

        The first 3 numbers are a translation [m]. If the target has an orientation, a rotation vector [rad] follows.
        """
        position, quat = self.pose()
        error = [goal - present for goal, present in zip(target.position, position)]
        if target.quat_xyzw is not None:
            error += rotation_between(quat, target.quat_xyzw)
        return np.array(error)

    def residual(self, target: Target, q: np.ndarray) -> Residual:
        """Sets the positions [rad or m] of the m joints, and returns the link's distance and angle to a target."""
        self.set(q)
        error = self.error(target).tolist()
        return Residual(math.hypot(*error[:3]), math.hypot(*error[3:]))

    def jacobian(self, q: np.ndarray, rows: int) -> np.ndarray:
        """Returns the Jacobian of the link's origin.

        Args:
            q: m joint positions [rad or m].
            rows: 3 for the linear part alone, 6 for the linear and the angular part.

        Returns:
            Shape (rows, m), in the axes of the base.
        """
        zeros = [0.0] * len(q)
        linear, angular = self.pb.calculateJacobian(
            self.body_id, self.link_index, [0.0, 0.0, 0.0], q.tolist(), zeros, zeros
        )
        return np.array(linear if rows == 3 else linear + angular)
