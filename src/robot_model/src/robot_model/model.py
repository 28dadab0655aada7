"""Robot model read from a URDF: joints, limits and kinematics."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import cached_property

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.transforms import finite_vector, pose_of

from .frames import LinkFrames
from .geometry import Pose
from .joint_map import AffineMap, Array
from .limits import Limits
from .urdf.document import UrdfDocument
from .urdf.elements import UrdfJoint
from .urdf.structure import check_structure

MAX_JOINTS = 500
"""Largest number of joints that are not fixed. Memory and time for kinematics grow with the square of this number."""
MAX_OUTSIDE = 0.1
"""Distance beyond the joint limits up to which the bounds of `RobotModel.reach` are valid [rad or m]."""


def read_robot(urdf_path: str, not_xml: str = "is not XML") -> UrdfDocument:
    """Reads a URDF and checks its structure.

    Args:
        urdf_path: Path of the URDF.
        not_xml: Start of the error message for a file that is not well-formed XML.

    Raises:
        ConfigError: If the file cannot be read or is not well-formed, if the structure or a joint is invalid, or if
            more than `MAX_JOINTS` joints are not fixed.
    """
    document = UrdfDocument(urdf_path, not_xml=not_xml)
    check_structure(document)
    if (moving := sum(kind != "fixed" for kind in document.joint_types.values())) > MAX_JOINTS:
        message = f"expected at most {MAX_JOINTS} joints that are not fixed, got {moving}"
        raise ConfigError([Problem(urdf_path, "", message)])
    try:
        _ = document.joints
    except ValueError as error:
        raise ConfigError([Problem(urdf_path, "", str(error))]) from None
    return document


class RobotModel:
    """Joints, limits and kinematics of a robot, whose links form a tree.

    A configuration has one position for each of n driven joints, in the order of `joint_names`. Mimic joints follow
    the joints that the URDF specifies. All other joints are at 0, or at the limit nearest to 0.

    Args:
        urdf_path: Path of the URDF; its meshes need not exist.
        joint_names: Names of the n driven joints. By default all joints with one axis, except mimic joints.

    Attributes:
        urdf_path: Path of the URDF.
        document: The parsed URDF.
        all_joints: All joints of the URDF, indexed by name.
        joint_names: Names of the n driven joints.
        joints: Descriptions of the n driven joints.
        limits: Limits of the n driven joints.
        links: Names of all links.
        root: Name of the root link.

    Raises:
        ConfigError: If the URDF cannot be read, or a joint is invalid.
        UnknownNameError: If a driven joint does not exist, is a mimic joint, or does not have one axis.
    """

    def __init__(self, urdf_path: str, joint_names: Sequence[str] = ()) -> None:
        self.urdf_path = urdf_path
        self.document = document = read_robot(urdf_path, "expected well-formed XML")
        self.all_joints = document.joints
        for name, mimic in document.mimics.items():
            if mimic.joint not in self.all_joints:
                message = f"joint '{name}' mimics '{mimic.joint}', which does not exist"
                raise ConfigError([Problem(urdf_path, "", message)])
        movable = [name for name, joint in self.all_joints.items() if joint.is_moving and joint.mimic is None]
        for name in joint_names:
            if name not in movable:
                raise UnknownNameError("joint that moves by itself", name, movable)
        self.joint_names = tuple(joint_names) or tuple(movable)
        if not self.joint_names:
            raise ConfigError([Problem(urdf_path, "", "expected a joint that moves, got none")])
        self.joints = [self.all_joints[name] for name in self.joint_names]
        self.limits = Limits.of_joints(self.joints)
        self.links: Collection[str] = document.links
        self.root = document.root_link()
        self._above = {joint.child: joint for joint in self.all_joints.values()}

    @cached_property
    def still(self) -> frozenset[str]:
        """Names of the fixed joints, which joint states may include."""
        return frozenset(name for name, joint in self.all_joints.items() if joint.type == "fixed")

    @cached_property
    def telescopic(self) -> tuple[str, ...]:
        """Names of the driven joints that move a prismatic joint beyond a moving revolute joint, seen from the root."""
        return tuple(dict.fromkeys(name for link in self.links for name in self._telescopic_to(link)))

    @cached_property
    def frames(self) -> LinkFrames:
        """Forward kinematics and Jacobians of all links."""
        return LinkFrames(self.all_joints.values(), self.map_to)

    def map_to(self, names: Sequence[str]) -> AffineMap:
        """Returns the map from positions of the n driven joints to positions of the joints called `names`."""
        driven = frozenset(self.joint_names)
        still = {name: joint.rest for name, joint in self.all_joints.items() if name not in driven}
        return AffineMap.of(names, self.joint_names, self.document.mimics, still)

    def pose(self, positions: Sequence[float], link: str, base: str | None = None) -> Pose:
        """Returns the pose of a link in another link.

        Args:
            positions: Positions of the n driven joints [rad or m].
            link: Name of the link.
            base: Name of the link in whose frame the pose is expressed; by default the root link.

        Raises:
            UnknownNameError: If `link` or `base` does not exist.
            ValueError: If `positions` are not n finite numbers.
        """
        q = finite_vector(positions, len(self.joint_names), "positions")[None]
        poses = []
        for name in (self.root if base is None else base, link):
            frame, in_frame = self.frames.place(self.check_link(name))
            position, quat = pose_of(self.frames.at(q)[0, frame] @ in_frame)
            poses.append(Pose(tuple(position.tolist()), tuple(quat.tolist())))
        return poses[0].inverse() @ poses[1]

    def check_link(self, name: str) -> str:
        """Checks that a link exists, and returns its name.

        Raises:
            UnknownNameError: If the link does not exist.
        """
        if name not in self.links:
            raise UnknownNameError("link", name, self.links)
        return name

    def chain(self, link: str) -> list[UrdfJoint]:
        """Returns all joints between the root and a link, fixed joints included, in the order from the root."""
        joints = []
        while link != self.root:
            joints.append(self._above[link])
            link = joints[-1].parent
        return joints[::-1]

    def reach(self, link: str, radius_m: float, other: str | None = None) -> Array:
        """Returns n upper bounds on the motion of a link's points relative to another link, shape (n,) [m/rad or 1].

        A bound is the largest distance that a point may move per 1 rad or 1 m of a joint's motion.

        Args:
            link: Name of the link.
            radius_m: Distance from the link's origin to the farthest point of its shape [m].
            other: Name of the link in which the motion is observed; by default the root. Joints above both links do
                not contribute.

        Raises:
            ConfigError: If a bound is infinite because a prismatic joint has no limits.
        """
        factors, _ = self._joint_motions
        common = {joint.name for joint in self.chain(self.root if other is None else other)}
        reach, beyond = np.zeros(len(self.joint_names)), radius_m
        for joint in reversed(self.chain(link)):
            if joint.name in common:
                break
            if joint.is_moving:
                moved = factors[joint.name].nonzero()  # other factors are 0, and 0 * inf would be NaN
                reach[moved] += factors[joint.name][moved] * (beyond if joint.is_revolute else 1.0)
            beyond += math.hypot(*joint.xyz)
            if joint.is_moving and not joint.is_revolute:
                beyond += self._travel(joint.name)
        if not np.isfinite(reach).all():
            name = self.joint_names[int(np.argmin(np.isfinite(reach)))]
            message = f"expected limits for prismatic joints between joint '{name}' and link '{link}'"
            raise ConfigError([Problem(self.urdf_path, "", message)])
        return reach

    @cached_property
    def _joint_motions(self) -> tuple[dict[str, Array], dict[str, float]]:
        """Absolute values of the map that `map_to` returns for all moving joints, as two dicts indexed by joint name.

        The first dict contains the n factors of each moving joint, the second dict the joint's offset [rad or m].
        """
        moving = [joint.name for joint in self.all_joints.values() if joint.is_moving]
        factors, offsets = self.map_to(moving)
        return dict(zip(moving, np.abs(factors))), dict(zip(moving, np.abs(offsets).tolist()))

    def _travel(self, name: str) -> float:
        """Returns a joint's largest absolute position [rad or m]; driven joints may exceed limits by `MAX_OUTSIDE`."""
        factors, offsets = self._joint_motions
        farthest = (max(abs(joint.lower), abs(joint.upper)) + MAX_OUTSIDE for joint in self.joints)
        travels = (factor * most for factor, most in zip(factors[name].tolist(), farthest) if factor)
        return offsets[name] + sum(travels)

    def _telescopic_to(self, link: str) -> list[str]:
        """Returns the names in `telescopic` for the chain from the root to one link; a name may occur repeatedly."""
        factors, _ = self._joint_motions
        turned, telescopic = False, []
        for joint in self.chain(link):
            if not joint.is_moving or not factors[joint.name].any():
                continue
            if joint.is_revolute:
                turned = True
            elif turned:
                telescopic.append(self.joint_names[int(factors[joint.name].argmax())])
        return telescopic
