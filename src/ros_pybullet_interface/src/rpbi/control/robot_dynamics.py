"""Dynamics and kinematics of a robot, computed from its URDF."""

from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.geometry import Quaternion, Vector
from robot_model.joint_map import AffineMap, Array
from rpbi.config.pybullet_models import LoadURDF
from rpbi.engine.client import Client
from rpbi.geometry import Pose, rotated_back
from rpbi.urdf.joints import JointModel
from rpbi.urdf.loading import load_urdf, urdf_problems

NO_TURN = (0.0, 0.0, 0.0, 1.0)


class RobotDynamics:
    """Computes the dynamics and kinematics of a robot with n driven joints and a base at rest.

    Loads the robot a second time, into a PyBullet client of its own, at the first computation. PyBullet uses the
    recursive Newton-Euler and composite-rigid-body algorithms. The results equal Pinocchio's up to rounding, and a
    call takes 1 to 5 microseconds. Attached bodies, and changes of the robot after loading, are not modelled. Joint
    values are in the order of `JointModel.driven`.

    PyBullet's inverse dynamics ignore the orientation of the base. Therefore, gravity is rotated into the base frame
    while the second robot remains upright at the origin.

    Args:
        world: PyBullet client of the simulated robot. The client's gravity is used.
        model: The robot's joints.
        load: Arguments with which the simulated robot was loaded.
        inertia_from_urdf: Whether moments of inertia are taken from the URDF rather than computed by PyBullet.
    """

    def __init__(self, world: Client, model: JointModel, load: LoadURDF, inertia_from_urdf: bool) -> None:
        self.joints = model.driven
        """The n driven joints, without the joints that are coupled to a driven joint."""
        self._moving = model.moving
        self._world = world
        self._load_arguments = load.kwargs()
        self._inertia_from_urdf = inertia_from_urdf
        self._zeros = [0.0] * len(model.moving)
        self._by_driven: AffineMap | None = model.by_driven if model.couplings else None
        self._base_joints = len(model.joints) - len(model.own)
        self._client: Client | None = None  # created at first use; the renderer's copy of a robot never needs it
        self._body_id = -1
        self._gravity: Vector | None = None
        self._points: dict[tuple[int, Vector], Vector] = {}
        """Points relative to the link's origin in the axes of the link's inertial frame, as PyBullet expects them.

        Keyed by link index and the point in the link's frame [m].
        """
        self._turned: Quaternion | None = None
        self._turn = np.eye(3)

    def mass_matrix(self, q: Sequence[float]) -> Array:
        """Returns the mass matrix [kg m^2, kg m, kg], shape (n, n), at n joint positions [rad or m]."""
        pb = self._client or self._load()
        mass = np.array(pb.calculateMassMatrix(self._body_id, self._positions(q)))
        return mass if self._by_driven is None else self._by_driven.factors.T @ mass @ self._by_driven.factors

    def bias(self, base: Pose, q: Sequence[float], velocity: Sequence[float]) -> Array:
        """Returns the efforts that compensate gravity, Coriolis and centrifugal forces.

        Args:
            base: Pose of the root link in the world frame.
            q: n joint positions [rad or m].
            velocity: n joint velocities [rad/s or m/s].

        Returns:
            n efforts [N m or N].
        """
        if not self.joints:
            return np.zeros(0)
        pb = self._client or self._load()
        self._turn_gravity(pb, base)
        if self._by_driven is None:
            return np.array(pb.calculateInverseDynamics(self._body_id, q, velocity, self._zeros))
        velocities = (self._by_driven.factors @ velocity).tolist()
        efforts = pb.calculateInverseDynamics(self._body_id, self._positions(q), velocities, self._zeros)
        efforts_of_driven: Array = self._by_driven.factors.T @ efforts
        return efforts_of_driven

    def gravity(self, base: Pose, q: Sequence[float]) -> Array:
        """Returns the n efforts [N m or N] that compensate gravity at rest; for the arguments see `bias`."""
        return self.bias(base, q, [0.0] * len(self.joints))

    def jacobian(self, base: Pose, q: Sequence[float], link: int, point: Vector = (0.0, 0.0, 0.0)) -> Array:
        """Returns the Jacobian of a point of a link.

        Args:
            base: Pose of the root link in the world frame.
            q: n joint positions [rad or m].
            link: PyBullet's index of the link.
            point: The point in the link's frame [m].

        Returns:
            Shape (6, n), in the axes of the world. Rows 0 to 2 give the velocity of the point [m/s], rows 3 to 5 the
            angular velocity of the link [rad/s].
        """
        pb = self._client or self._load()
        link -= self._base_joints
        if (link, point) not in self._points:
            self._points[link, point] = rotated_back(pb.getLinkState(self._body_id, link)[3], point)
        point = self._points[link, point]
        positions = self._positions(q)
        linear, angular = pb.calculateJacobian(self._body_id, link, point, positions, self._zeros, self._zeros)
        if base.quat_xyzw != self._turned:
            self._turned = base.quat_xyzw
            self._turn = np.array(pb.getMatrixFromQuaternion(base.quat_xyzw)).reshape(3, 3)
        jacobian = np.array(linear + angular)
        if self._turned != NO_TURN:
            jacobian = (self._turn @ jacobian.reshape(2, 3, -1)).reshape(6, -1)
        return jacobian if self._by_driven is None else jacobian @ self._by_driven.factors

    def pose(self, base: Pose, q: Sequence[float], link: int) -> Pose:
        """Returns the pose of a link's URDF frame in the world frame (forward kinematics).

        Args:
            base: Pose of the root link in the world frame.
            q: n joint positions [rad or m].
            link: PyBullet's index of the link.
        """
        pb = self._client or self._load()
        for joint, position in zip(self._moving, self._positions(q)):
            pb.resetJointState(self._body_id, joint.index - self._base_joints, position)
        state = pb.getLinkState(self._body_id, link - self._base_joints, computeForwardKinematics=True)
        return base @ Pose(state[4], state[5])

    def close(self) -> None:
        """Closes the PyBullet client that holds the second robot."""
        if self._client is not None:
            self._client.disconnect()
            self._client = None

    def _positions(self, q: Sequence[float]) -> Sequence[float]:
        """Returns the positions of all joints with one axis, including coupled joints.

        The result is computed from the positions `q` of the n driven joints.
        """
        if self._by_driven is None:
            return q
        positions: list[float] = (self._by_driven.factors @ q + self._by_driven.offsets).tolist()
        return positions

    def _turn_gravity(self, pb: Client, base: Pose) -> None:
        in_base = rotated_back(base.quat_xyzw, self._world.gravity)
        if in_base != self._gravity:
            pb.setGravity(*in_base)
            self._gravity = in_base

    def _load(self) -> Client:
        pb = self._client = Client()
        kept = {
            key: value for key, value in self._load_arguments.items() if key in ("fileName", "flags", "globalScaling")
        }
        arguments = {**kept, "useFixedBase": True}
        if problems := urdf_problems(arguments["fileName"]):  # it may have changed since the robot was loaded
            raise ConfigError([Problem("the model", "loadURDF.fileName", problem) for problem in problems])
        self._body_id = load_urdf(pb, "the model", arguments, inertia_from_urdf=self._inertia_from_urdf)
        return pb
