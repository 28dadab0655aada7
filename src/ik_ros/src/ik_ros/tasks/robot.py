"""A robot in Pinocchio."""

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
    """Returns a pose as a `pinocchio.SE3`."""
    return pin.XYZQUATToSE3(np.array((*pose.position, *pose.quat_xyzw)))


def from_base(q: np.ndarray) -> Pose:
    """Returns the pose of a floating root in a configuration."""
    x, y, z, qx, qy, qz, qw = q[:7].tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))


FREE = 6
"""Degrees of freedom of a floating base."""


class PinocchioRobot:
    """Joints, limits and kinematics of one robot, a tree of links whose root may float.

    A configuration q has one number for each joint. With a floating root, 7 numbers come first: x, y, z [m] and a
    quaternion x, y, z, w. A velocity has one number for each joint, after 6 for a floating root.

    Args:
        urdf_path: The robot's description; the meshes it names need not be there.
        floating: Whether the root floats.
        joints: The n joints to find positions for; by default all that move.
        base: The link that poses are expressed in; None: the root, or the world if the root floats.

    Attributes:
        model: Pinocchio's model.
        data: Pinocchio's working memory, set by `update`.
        joint_names: The n joints.
        lower: Their n lower limits [rad or m], -inf where there is none.
        upper: Their n upper limits [rad or m], inf where there is none.
        limits: The same limits as an object, which can clip positions.
        is_revolute: Which of the n joints turn.
        max_velocity: Their n largest speeds [rad/s or m/s], inf where the URDF has none.
        free: Indices in a velocity of the m free components: m - n of the root, and the n joints.
        all_joints: All joints that move.
        links: All links.

    Raises:
        ConfigError: If the description cannot be read, or has joints of more than one axis.
        UnknownNameError: If a joint or the base is not known.
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
        base_joints = 2 if floating else 1  # the world, and the root's own
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
            UnknownNameError: If there is no such joint that moves.
        """
        return int(self.model.getJointId(_known("joint", name, self.all_joints)))

    def moving(self, names: Iterable[str]) -> list[str]:
        """Returns the given joints that move by themselves, without fixed and mimic joints.

        Raises:
            UnknownNameError: If there is no such joint.
        """
        return [_known("joint", name, self.all_joints) for name in names if name not in self._still]

    def index(self, name: str) -> int:
        """Returns the index of a joint among the n.

        Raises:
            UnknownNameError: If it is none of them.
        """
        return self.joint_names.index(_known("joint", name, self.joint_names))

    def link_id(self, name: str) -> int:
        """Returns Pinocchio's index of a link.

        Raises:
            UnknownNameError: If there is no such link.
        """
        return int(self.model.getFrameId(_known("link", name, self.links), pin.BODY))

    def add_frame(self, name: str, link: str, pose: Pose) -> None:
        """Adds a frame at a link; tasks can use its name like that of a link.

        Raises:
            UnknownNameError: If the link is not known.
        """
        link_id = self.link_id(link)
        frame = self.model.frames[link_id]
        placement = frame.placement * to_se3(pose)
        self.model.addFrame(pin.Frame(name, frame.parent, link_id, placement, pin.BODY))
        self.data = self.model.createData()
        self.links += (name,)

    def add_shape(self, config: ShapeConfig) -> None:
        """Adds a shape.

        Raises:
            UnknownNameError: If its link is not known.
        """
        link_id = None if config.link is None else self.link_id(config.link)
        self._shapes[config.name] = RobotShape(config.core, link_id, to_se3(config.pose))

    def shape(self, name: str) -> RobotShape:
        """Returns one of the shapes.

        Raises:
            UnknownNameError: If there is no such shape.
        """
        return self._shapes[_known("shape", name, self._shapes)]

    def configuration(self, positions: Mapping[str, float]) -> np.ndarray:
        """Returns the configuration with some joints at given positions, and the others in the middle of their limits.

        Joints that do not move, which joint states may include, are ignored.

        Raises:
            UnknownNameError: If a joint is not known.
        """
        q = pin.neutral(self.model)
        q[self._in_q] = self.limits.middle
        for name in self.moving(positions):
            q[self.model.joints[self.joint_id(name)].idx_q] = positions[name]
        return q

    def positions(self, q: np.ndarray) -> np.ndarray:
        """Returns the positions of the n joints [rad or m]."""
        return q[self._in_q]

    def with_positions(self, q: np.ndarray, positions: Sequence[float] | np.ndarray) -> np.ndarray:
        """Returns a configuration with the n joints at other positions [rad or m]."""
        changed = q.copy()
        changed[self._in_q] = positions
        return changed

    def with_base(self, q: np.ndarray, pose: Any) -> np.ndarray:
        """Returns a configuration with a floating root at another pose, a `pinocchio.SE3`."""
        changed = q.copy()
        changed[:7] = pin.SE3ToXYZQUAT(pose)
        return changed

    def moved(self, q: np.ndarray, step: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Returns the configuration after a step of the free components, within n lower and n upper limits [rad or
        m]."""
        if not self.is_floating:
            positions = q[self._in_q] + step
        else:
            velocity = np.zeros(self.model.nv)
            velocity[:FREE] = step[:FREE]
            q = pin.integrate(self.model, q, velocity)
            positions = q[self._in_q] + step[FREE:]
        return self.with_positions(q, np.minimum(np.maximum(positions, lower), upper))

    def update(self, q: np.ndarray) -> None:
        """Sets the configuration for the methods below."""
        pin.computeJointJacobians(self.model, self.data, q)

    def frame(self, link_id: int) -> Any:
        """Returns the pose of a link, a `pinocchio.SE3`."""
        return pin.updateFramePlacement(self.model, self.data, link_id)

    def jacobian(self, link_id: int) -> np.ndarray:
        """Returns the Jacobian of a link in its own frame for the free components, 6 x m: linear above angular."""
        return self._of_free(pin.getFrameJacobian(self.model, self.data, link_id, pin.LOCAL))

    def com(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the centre of mass [m], and its Jacobian for the free components, 3 x m."""
        jacobian = self._of_free(pin.jacobianCenterOfMass(self.model, self.data, q))
        com, moving, still = self.data.com[0].copy(), self.data.mass[0], self.model.inertias[0]
        if still.mass:  # Pinocchio omits the mass of fixed links
            part = moving / (moving + still.mass)
            return part * com + (1.0 - part) * still.lever, part * jacobian
        return com, jacobian

    def joint_rows(self, indices: Sequence[int]) -> np.ndarray:
        """Returns the Jacobian of the positions of some of the n joints: a 1 in each row."""
        first = len(self.free) - len(self.joint_names)
        return np.eye(len(self.free))[[first + i for i in indices]]

    def _of_free(self, jacobian: np.ndarray) -> np.ndarray:
        return jacobian if self._all_free else jacobian[:, self.free]


def _known(kind: str, name: str, names: Collection[str]) -> str:
    """Returns a name; raises `UnknownNameError` if it is none of these."""
    if name not in names:
        raise UnknownNameError(kind, name, names)
    return name
