"""A robot whose kinematics are computed by Pinocchio."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from ik_ros.shape import ShapeConfig
from robot_model.geometry import Pose
from robot_model.limits import Limits
from robot_model.model import read_robot
from robot_model.urdf.copies import with_limited_joints
from robot_model.urdf.elements import MOVING

from .clearance import RobotShape


def to_se3(pose: Pose) -> Any:
    """Converts a pose to a `pinocchio.SE3`."""
    return pin.XYZQUATToSE3(np.array((*pose.position, *pose.quat_xyzw)))


def from_base(q: np.ndarray) -> Pose:
    """Returns the pose of a floating root, which a configuration q contains as its first 7 numbers."""
    x, y, z, qx, qy, qz, qw = q[:7].tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))


FREE = 6
"""Degrees of freedom of a floating base."""


class PinocchioRobot:
    """Joints, limits and kinematics of one robot, a tree of links whose root may float.

    A configuration q has one position for each moving joint [rad or m]. If the root floats, 7 numbers precede the joint
    positions: x, y, z [m] and a quaternion x, y, z, w. A velocity has one number for each moving joint. If the root
    floats, 6 numbers precede the joint velocities.

    Args:
        urdf_path: Path of the URDF; its meshes need not exist.
        floating: Whether the root floats.
        joints: Names of the n joints to find positions for; by default all moving joints.
        base: Link in whose frame poses are expressed. None: the root, or the world if the root floats.

    Attributes:
        model: Pinocchio's model.
        data: Pinocchio's data for the configuration set by `update`.
        joint_names: Names of the n joints.
        lower: Lower limits of the n joints [rad or m]; -inf for joints without a lower limit.
        upper: Upper limits of the n joints [rad or m]; inf for joints without an upper limit.
        limits: The same limits as a `Limits` object.
        is_revolute: n flags, true for revolute and continuous joints.
        max_velocity: Largest speeds of the n joints [rad/s or m/s]; inf for joints without a speed limit.
        free: Indices of the m components of a velocity that are solved for: 6 of a floating root, then the n joints.
        all_joints: Names of all moving joints.
        links: Names of all links and added frames.

    Raises:
        ConfigError: If the URDF cannot be read, or has joints with more than one axis.
        UnknownNameError: If a joint or the link `base` does not exist.
    """

    def __init__(
        self, urdf_path: str, floating: bool = False, joints: Sequence[str] = (), base: str | None = None
    ) -> None:
        document = read_robot(urdf_path)
        types = document.joint_types
        for name, kind in types.items():
            if kind not in (*MOVING, "fixed"):
                raise ConfigError([Problem(urdf_path, name, f"expected a joint of one axis, got a {kind} one")])
        if base is not None:
            _known("link", base, document.links)
        try:
            root = [pin.JointModelFreeFlyer()] if floating else []
            self.model = pin.buildModelFromXML(with_limited_joints(document, base), *root)
        except ValueError as error:
            raise ConfigError([Problem(urdf_path, "", f"Pinocchio cannot load it: {error}")]) from None
        self.data = self.model.createData()
        self.is_floating = floating
        base_joints = 2 if floating else 1  # Pinocchio's joint of the world, and the floating root's joint
        self.all_joints = tuple(self.model.names)[base_joints:]
        self._still = frozenset(types) - frozenset(self.all_joints)
        frames = (frame.name for frame in self.model.frames if frame.type == pin.BODY)
        self.links = tuple(name for name in frames if name in document.links)
        self.joint_names = tuple(joints) or self.all_joints
        ids = [self.joint_id(name) for name in self.joint_names]
        self._in_q = np.array([self.model.joints[i].idx_q for i in ids], dtype=int)
        in_v = [self.model.joints[i].idx_v for i in ids]
        self.free = np.array([*range(FREE if floating else 0), *in_v], dtype=int)
        self._all_free = self.free.tolist() == list(range(self.model.nv))
        joints_of_n = [document.joints[name] for name in self.joint_names]
        self.limits = Limits.of_joints(joints_of_n)
        self.lower, self.upper = np.array(self.limits.lower), np.array(self.limits.upper)
        self.is_revolute = list(self.limits.is_revolute)
        self.max_velocity = np.array([joint.max_velocity for joint in joints_of_n])
        self._shapes: dict[str, RobotShape] = {}

    def joint_id(self, name: str) -> int:
        """Returns Pinocchio's index of a joint.

        Raises:
            UnknownNameError: If no moving joint has this name.
        """
        return int(self.model.getJointId(_known("joint", name, self.all_joints)))

    def moving(self, names: Iterable[str]) -> list[str]:
        """Returns joint names without the names of fixed joints and mimic joints.

        Raises:
            UnknownNameError: If a joint does not exist.
        """
        return [_known("joint", name, self.all_joints) for name in names if name not in self._still]

    def index(self, name: str) -> int:
        """Returns the index of a joint in `joint_names`.

        Raises:
            UnknownNameError: If `joint_names` does not contain the joint.
        """
        return self.joint_names.index(_known("joint", name, self.joint_names))

    def link_id(self, name: str) -> int:
        """Returns Pinocchio's index of a link or added frame.

        Raises:
            UnknownNameError: If the link does not exist.
        """
        return int(self.model.getFrameId(_known("link", name, self.links), pin.BODY))

    def add_frame(self, name: str, link: str, pose: Pose) -> None:
        """Adds a frame that is attached to a link; tasks can use the frame's name like a link name.

        Args:
            name: Name of the frame.
            link: Name of the link.
            pose: Pose of the frame in the link.

        Raises:
            UnknownNameError: If the link does not exist.
        """
        link_id = self.link_id(link)
        frame = self.model.frames[link_id]
        placement = frame.placement * to_se3(pose)
        self.model.addFrame(pin.Frame(name, frame.parent, link_id, placement, pin.BODY))
        self.data = self.model.createData()
        self.links += (name,)

    def add_shape(self, config: ShapeConfig) -> None:
        """Adds a shape that is attached to a link, or fixed in the base frame.

        Raises:
            UnknownNameError: If the link does not exist.
        """
        link_id = None if config.link is None else self.link_id(config.link)
        self._shapes[config.name] = RobotShape(config.core, link_id, to_se3(config.pose))

    def shape(self, name: str) -> RobotShape:
        """Returns an added shape by its name.

        Raises:
            UnknownNameError: If no shape has this name.
        """
        return self._shapes[_known("shape", name, self._shapes)]

    def configuration(self, positions: Mapping[str, float]) -> np.ndarray:
        """Makes a configuration from joint positions.

        For joints that `positions` leaves out, uses defaults: the middle of the limits for the n joints, and 0 for all
        other moving joints.

        Args:
            positions: Positions by joint name [rad or m]. Fixed and mimic joints are ignored.

        Raises:
            UnknownNameError: If a joint does not exist.
        """
        q = pin.neutral(self.model)
        q[self._in_q] = self.limits.middle
        for name in self.moving(positions):
            q[self.model.joints[self.joint_id(name)].idx_q] = positions[name]
        return q

    def positions(self, q: np.ndarray) -> np.ndarray:
        """Returns the positions of the n joints in a configuration [rad or m]."""
        return q[self._in_q]

    def with_positions(self, q: np.ndarray, positions: Sequence[float] | np.ndarray) -> np.ndarray:
        """Returns a copy of a configuration with new positions of the n joints [rad or m]."""
        changed = q.copy()
        changed[self._in_q] = positions
        return changed

    def with_base(self, q: np.ndarray, pose: Any) -> np.ndarray:
        """Returns a copy of a configuration with a new pose of the floating root, a `pinocchio.SE3`."""
        changed = q.copy()
        changed[:7] = pin.SE3ToXYZQUAT(pose)
        return changed

    def moved(self, q: np.ndarray, step: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Returns the configuration after a step, in which the n joints are clipped to limits.

        Args:
            q: The configuration before the step.
            step: Motion of the m components in `free`, shape (m,) [rad or m].
            lower: Lower limits of the n joints [rad or m].
            upper: Upper limits of the n joints [rad or m].
        """
        if not self.is_floating:
            positions = q[self._in_q] + step
        else:
            velocity = np.zeros(self.model.nv)
            velocity[:FREE] = step[:FREE]
            q = pin.integrate(self.model, q, velocity)
            positions = q[self._in_q] + step[FREE:]
        return self.with_positions(q, np.minimum(np.maximum(positions, lower), upper))

    def update(self, q: np.ndarray) -> None:
        """Sets the configuration q for which `frame` and `jacobian` return results."""
        pin.computeJointJacobians(self.model, self.data, q)

    def frame(self, link_id: int) -> Any:
        """Returns the pose of a link in the base frame, a `pinocchio.SE3`, in the configuration set by `update`."""
        return pin.updateFramePlacement(self.model, self.data, link_id)

    def jacobian(self, link_id: int) -> np.ndarray:
        """Returns the matrix that maps the m velocity components in `free` to a link's velocity, 6 x m.

        The link's velocity is in the link's axes, the first three rows linear, the last three angular. The
        configuration is the one set by `update`.
        """
        return self._of_free(pin.getFrameJacobian(self.model, self.data, link_id, pin.LOCAL))

    def com(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the robot's centre of mass in the configuration q, and the centre's Jacobian, both in the base frame.

        The centre has the shape (3,) [m]. The Jacobian, 3 x m, maps the m velocity components in `free` to the centre's
        velocity.
        """
        jacobian = self._of_free(pin.jacobianCenterOfMass(self.model, self.data, q))
        com, moving, still = self.data.com[0].copy(), self.data.mass[0], self.model.inertias[0]
        if still.mass:  # Pinocchio omits the mass of fixed links
            part = moving / (moving + still.mass)
            return part * com + (1.0 - part) * still.lever, part * jacobian
        return com, jacobian

    def joint_rows(self, indices: Sequence[int]) -> np.ndarray:
        """Returns the k x m matrix that selects k joints' velocities from the m velocity components in `free`.

        Args:
            indices: Indices of the k joints in `joint_names`.
        """
        first = len(self.free) - len(self.joint_names)
        return np.eye(len(self.free))[[first + i for i in indices]]

    def _of_free(self, jacobian: np.ndarray) -> np.ndarray:
        return jacobian if self._all_free else jacobian[:, self.free]


def _known(kind: str, name: str, names: Collection[str]) -> str:
    """Returns `name` if `names` contains it, and raises an `UnknownNameError` otherwise."""
    if name not in names:
        raise UnknownNameError(kind, name, names)
    return name
