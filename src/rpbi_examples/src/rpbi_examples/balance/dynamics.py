"""The dynamics of a robot with a floating base, computed by Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import MissingDependency, UnknownNameError
from robot_model.geometry import Quaternion
from rpbi.control.controllers.controller import Array, RobotState

try:
    import pinocchio as pin
except ImportError as error:
    raise MissingDependency(error.name or "pinocchio", "./rpbi setup ik") from None

FREE = 6
"""Number of velocities of the floating base: 3 linear and 3 angular velocities, in the base's axes."""


class FrameMotion(NamedTuple):
    """Motion of a frame, or of the centre of mass, for a robot with n velocities.

    For a frame, the arrays have 6 rows: 3 linear rows [m] and then 3 angular rows [rad]. For the centre of mass, the
    arrays have 3 linear rows.

    Attributes:
        jacobian: Maps the robot's velocities to `velocity`, shape (6, n) or (3, n).
        velocity: Velocity, shape (6,) or (3,).
        drift: Acceleration if the robot's velocities v stay constant (dJ/dt v), shape (6,) or (3,).
    """

    jacobian: Array
    velocity: Array
    drift: Array


class FloatingRobot:
    """Computes mass matrix, bias and kinematics of a robot with a floating base.

    The robot has n velocities: 6 of the base and one for each joint. `update` sets the attributes that depend on the
    state. In the attributes, joints are in Pinocchio's order; see `in_given_order`.

    Args:
        urdf_filename: The robot's URDF file.
        joints: Names of all movable joints, in the order of the joint values in the states for `update`.

    Attributes:
        mass_matrix: Mass matrix, shape (n, n).
        bias: Sum of gravity, Coriolis and centrifugal forces, and joint damping, shape (n,) [N, N m].
        positions: Positions of the joints, shape (n - 6,) [rad].
        velocities: Velocities of base and joints, shape (n,) [m/s, rad/s].
        count: The number n of velocities.
        effort_limits: Effort limits of the joints, shape (n - 6,) [N m].
        lower: Lower position limits of the joints, shape (n - 6,) [rad].
        upper: Upper position limits of the joints, shape (n - 6,) [rad].
        centre: The centre of mass in the world, shape (3,) [m].

    Raises:
        ValueError: If `joints` does not contain exactly the movable joints of the URDF.
    """

    def __init__(self, urdf_filename: str, joints: Sequence[str]) -> None:
        self._model = pin.buildModelFromUrdf(urdf_filename, pin.JointModelFreeFlyer())
        known = list(self._model.names)[2:]
        if set(joints) != set(known):
            different = ", ".join(sorted(set(joints) ^ set(known)))
            raise ValueError(f"joints: expected all {len(known)} of {urdf_filename}, got others: {different}")
        self._data = self._model.createData()
        self._order = np.array([joints.index(name) for name in known])
        self.effort_limits: Array = self._model.effortLimit[FREE:].copy()
        self.lower: Array = self._model.lowerPositionLimit[FREE + 1 :].copy()
        self.upper: Array = self._model.upperPositionLimit[FREE + 1 :].copy()
        self._still = np.zeros(self._model.nv)
        self._below = np.tril_indices(self._model.nv, -1)
        self.count: int = self._model.nv

    def frame(self, link: str, point: Sequence[float] = (0.0, 0.0, 0.0)) -> int:
        """Adds a frame to a link, and returns the index of the new frame.

        Args:
            link: Name of the link.
            point: Origin of the new frame, in the link's frame [m].

        Raises:
            UnknownNameError: If the robot does not have the link.
        """
        model = self._model
        if not model.existFrame(link):
            raise UnknownNameError("link", link, [each.name for each in model.frames])
        above = model.frames[model.getFrameId(link)]
        place = above.placement * pin.SE3(np.eye(3), np.array(point))
        name = f"{link}/{model.nframes}"
        number = model.addFrame(pin.Frame(name, above.parent, model.getFrameId(link), place, pin.OP_FRAME))
        self._data = model.createData()
        return int(number)

    def in_given_order(self, of_joints: Array) -> Array:
        """Reorders an array with one value for each joint, from Pinocchio's joint order to the order of `joints`."""
        ordered = np.empty_like(of_joints)
        ordered[self._order] = of_joints
        return ordered

    def update(self, state: RobotState) -> None:
        """Computes the attributes and the motion of all frames for a robot state."""
        model, data = self._model, self._data
        turn = pin.Quaternion(np.array(state.base.quat_xyzw)).normalized()
        back = turn.matrix().T
        linear, angular = back @ state.base_twist.linear, back @ state.base_twist.angular
        self.positions = np.array(state.position)[self._order]
        self.velocities = v = np.concatenate((linear, angular, np.array(state.velocity)[self._order]))
        q = np.concatenate((state.base.position, turn.coeffs(), self.positions))
        self.mass_matrix = mass = pin.crba(model, data, q)  # the upper half
        mass[self._below] = mass.T[self._below]
        self.bias = pin.nonLinearEffects(model, data, q, v) + model.damping * v
        pin.computeJointJacobians(model, data, q)
        self._jacobian_of_centre = pin.jacobianCenterOfMass(model, data, q)
        pin.centerOfMass(model, data, q, v, self._still)  # also computes the drift of all frames
        pin.updateFramePlacements(model, data)
        self.centre = data.com[0].copy()

    def placement(self, frame: int) -> Any:
        """Returns the pose of a frame in the world, as an `SE3` of Pinocchio."""
        return self._data.oMf[frame]

    def motion_of_centre(self) -> FrameMotion:
        """Returns the motion of the centre of mass, in the world's axes."""
        return FrameMotion(self._jacobian_of_centre, self._data.vcom[0], self._data.acom[0])

    def motion(self, frame: int, own_axes: bool = False) -> FrameMotion:
        """Returns the motion of a frame's origin, in the frame's axes if `own_axes`, otherwise in the world's axes."""
        axes = pin.LOCAL if own_axes else pin.LOCAL_WORLD_ALIGNED
        return FrameMotion(
            pin.getFrameJacobian(self._model, self._data, frame, axes),
            pin.getFrameVelocity(self._model, self._data, frame, axes).vector,
            pin.getFrameClassicalAcceleration(self._model, self._data, frame, axes).vector,
        )


def rotation_of(quat_xyzw: Quaternion) -> Array:
    """Returns the rotation matrix of a unit quaternion, shape (3, 3)."""
    rotation: Array = pin.Quaternion(np.array(quat_xyzw)).matrix()
    return rotation


def turn_between(start: Array, end: Array) -> Array:
    """Returns the rotation vector, in the world's axes, from the rotation matrix `start` to `end` [rad]."""
    turn: Array = pin.log3(end @ start.T)
    return turn


def turned(start: Array, turn: Array) -> Array:
    """Rotates the rotation matrix `start` by a rotation vector in the world's axes [rad], and returns the result."""
    end: Array = pin.exp3(turn) @ start
    return end
