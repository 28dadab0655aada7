"""Forward kinematics of a chain of joints."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import PyKDL

from rpbi.geometry import Pose
from rpbi.kinematics.limits import Reach

from .description import ChainDescription


class Chain:
    """Where the tip of a chain is, and how it moves.

    The Orocos Kinematics and Dynamics Library does the work, since it takes a microsecond. One thread at a time.

    Args:
        description: The chain.

    Attributes:
        kdl: KDL's chain; its m joints are those that are not fixed.
        is_plain: Whether the m joints are the n variables, since none mimics another.
        reach: How far they bring the tip.
    """

    def __init__(self, description: ChainDescription) -> None:
        self._drives = description.drives
        self.is_plain = [drive.variable for drive in self._drives] == list(range(len(self._drives))) and (
            not description.mimics
        )
        self.kdl = _kdl_chain(description)
        moving = [joint for joint in description.joints if joint.is_moving]
        self._positions = PyKDL.JntArray(len(self._drives))
        self._frame = PyKDL.Frame()
        self._jacobian = PyKDL.Jacobian(len(self._drives))
        self._to_frame = PyKDL.ChainFkSolverPos_recursive(self.kdl)
        self._to_jacobian = PyKDL.ChainJntToJacSolver(self.kdl)
        self._variables = np.zeros((len(self._drives), len(description.joint_names)))
        for joint, drive in enumerate(self._drives):
            self._variables[joint, drive.variable] = drive.multiplier
        x, y, z = self.kdl.getSegment(0).getJoint().JointOrigin()
        carried = description.joints[description.joints.index(moving[0]) + 1 :]
        self.reach = Reach.of((x, y, z), [math.hypot(*joint.xyz) for joint in carried], moving)

    def frame(self, q: Sequence[float]) -> PyKDL.Frame:
        """Returns the pose of the tip in the base, valid until the next call.

        Args:
            q: n positions [rad or m].
        """
        self._set(q)
        self._to_frame.JntToCart(self._positions, self._frame)
        return self._frame

    def pose(self, q: Sequence[float]) -> Pose:
        """Returns the pose of the tip in the base."""
        frame = self.frame(q)
        x, y, z = frame.p
        return Pose((x, y, z), frame.M.GetQuaternion())

    def jacobian(self, q: Sequence[float]) -> np.ndarray:
        """Returns how the tip moves with the joints, in the base: 6 x n, 3 rows [m], 3 rows of a rotation [rad]."""
        self._set(q)
        self._to_jacobian.JntToJac(self._positions, self._jacobian)
        joints = range(len(self._drives))
        values = [self._jacobian[row, joint] for row in range(6) for joint in joints]
        jacobian = np.array(values).reshape(6, len(self._drives))
        return jacobian if self.is_plain else jacobian @ self._variables

    def _set(self, q: Sequence[float]) -> None:
        positions = self._positions
        if self.is_plain:
            for i, position in enumerate(q):
                positions[i] = position
        else:
            for i, drive in enumerate(self._drives):
                positions[i] = drive.multiplier * q[drive.variable] + drive.offset


def _kdl_chain(description: ChainDescription) -> PyKDL.Chain:
    chain = PyKDL.Chain()
    fixed = PyKDL.Frame()  # of the joint's parent link in the link that the last moving joint moves
    for joint in description.joints:
        origin = fixed * PyKDL.Frame(PyKDL.Rotation.RPY(*joint.rpy), PyKDL.Vector(*joint.xyz))
        if not joint.is_moving:
            fixed = origin
            continue
        kind = PyKDL.Joint.RotAxis if joint.is_revolute else PyKDL.Joint.TransAxis
        kdl_joint = PyKDL.Joint(joint.name, origin.p, origin.M * PyKDL.Vector(*joint.axis), kind)
        chain.addSegment(PyKDL.Segment(joint.child, kdl_joint, origin))
        fixed = PyKDL.Frame()
    chain.addSegment(PyKDL.Segment(description.tip, PyKDL.Joint(PyKDL.Joint.Fixed), fixed))
    return chain
