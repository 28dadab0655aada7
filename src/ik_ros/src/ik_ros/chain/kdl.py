"""Computes chain kinematics and pose errors with the Orocos Kinematics and Dynamics Library (KDL)."""

import math
from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import MissingDependency

try:
    import PyKDL as PyKDL  # also for the solver
except ImportError:
    raise MissingDependency("PyKDL", "apt install python3-pykdl; pip has no package of it") from None

from ik_ros.problem import IKProblem
from robot_model.chain import Chain
from robot_model.geometry import Pose
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, Residual


class KdlChain:
    """Forward kinematics and Jacobian of a chain's tip; not thread-safe.

    Args:
        description: The chain, with n joints to solve for.

    Attributes:
        kdl: KDL's object for the chain. Its m joints are all moving joints, including mimic joints.
        is_plain: True if the chain has no mimic joints. Then the m joints are the n joints to solve for.
    """

    def __init__(self, description: Chain) -> None:
        self._to_moving = description.to_moving
        self.is_plain = not description.mimics
        self.kdl = _kdl_chain(description)
        self._positions = PyKDL.JntArray(len(description.moving))
        self._frame = PyKDL.Frame()
        self._jacobian = PyKDL.Jacobian(len(description.moving))
        self._to_frame = PyKDL.ChainFkSolverPos_recursive(self.kdl)
        self._to_jacobian = PyKDL.ChainJntToJacSolver(self.kdl)

    def frame(self, q: Sequence[float]) -> PyKDL.Frame:
        """Returns the pose of the tip in the base frame at n joint positions [rad or m].

        The next call overwrites the returned object.
        """
        self._set(q)
        self._to_frame.JntToCart(self._positions, self._frame)
        return self._frame

    def pose(self, q: Sequence[float]) -> Pose:
        """Returns the pose of the tip in the base frame at n joint positions [rad or m]."""
        frame = self.frame(q)
        x, y, z = frame.p
        return Pose((x, y, z), frame.M.GetQuaternion())

    def jacobian(self, q: Sequence[float]) -> np.ndarray:
        """Returns the Jacobian of the tip in the axes of the base, 6 x n: linear rows, then angular rows."""
        self._set(q)
        self._to_jacobian.JntToJac(self._positions, self._jacobian)
        joints = range(self._jacobian.columns())
        jacobian = np.array([[self._jacobian[row, joint] for joint in joints] for row in range(6)])
        return jacobian if self.is_plain else jacobian @ self._to_moving.factors

    def _set(self, q: Sequence[float]) -> None:
        for i, position in enumerate(q if self.is_plain else self._to_moving(np.array(q)).tolist()):
            self._positions[i] = position


class Goal:
    """The target pose of a problem, with tolerances for each axis.

    Attributes:
        frame: Pose of the target in the base frame.
        inverse: Pose of the base in the target frame.
        tolerance: Largest allowed errors of the link's pose in the target frame: 3 distances [m], and 3 components of
            the rotation vector from target to link [rad]. A component is inf if the rotation is free.
        is_point: Whether all tolerances are at most the default tolerances, `POSITION_TOLERANCE_M` and
            `ORIENTATION_TOLERANCE_RAD`.

    Raises:
        ValueError: If the problem has no target.
    """

    def __init__(self, problem: IKProblem) -> None:
        if problem.target is None:
            raise ValueError("target: missing; this solver moves one link to a pose")
        position, quat_xyzw = problem.target
        self.frame = PyKDL.Frame(PyKDL.Rotation.Quaternion(*quat_xyzw), PyKDL.Vector(*position))
        self.inverse = self.frame.Inverse()
        turns = (math.inf if angle >= math.pi else angle for angle in problem.rotation_tolerance)
        self.tolerance = (*problem.position_tolerance, *turns)
        self.is_point = (
            max(problem.position_tolerance) <= POSITION_TOLERANCE_M
            and max(problem.rotation_tolerance) <= ORIENTATION_TOLERANCE_RAD
        )

    @property
    def any_orientation(self) -> bool:
        """Whether every orientation of the link is accepted."""
        return min(self.tolerance[3:]) == math.inf

    def off(self, frame: PyKDL.Frame) -> list[float]:
        """Returns the error of a link pose: 3 distances [m] and a rotation vector [rad], in the target frame."""
        difference = self.inverse * frame
        p, turn = difference.p, difference.M.GetRot()
        return [p[0], p[1], p[2], turn[0], turn[1], turn[2]]

    def beyond(self, off: list[float]) -> list[float]:
        """Returns by how much each of 6 errors exceeds its tolerance, with the sign of the error."""
        return [math.copysign(max(abs(value) - tolerance, 0.0), value) for value, tolerance in zip(off, self.tolerance)]

    def residual(self, frame: PyKDL.Frame) -> Residual:
        """Returns the parts of a link pose's position and orientation error that exceed the tolerances."""
        x, y, z, rx, ry, rz = self.beyond(self.off(frame))
        return Residual(math.hypot(x, y, z), math.hypot(rx, ry, rz))


def _kdl_chain(description: Chain) -> PyKDL.Chain:
    chain = PyKDL.Chain()
    fixed = PyKDL.Frame()  # pose of the joint's parent link in the child link of the last moving joint
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
