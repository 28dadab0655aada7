"""A robot as its URDF describes it: joints, limits and kinematics."""

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
"""Largest number of joints that are not fixed; memory and time of kinematics grow with its square."""
MAX_OUTSIDE = 0.1
"""Distance outside its limits up to which `RobotModel.reach` holds for a prismatic joint [rad or m]."""


def read_robot(urdf_path: str, not_xml: str = "is not XML") -> UrdfDocument:
    """Returns a URDF whose structure is sound.

    Raises:
        ConfigError: If the file cannot be read, is not well-formed, describes no robot, or one with more than
            `MAX_JOINTS` joints that are not fixed, or a joint makes no sense.
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
    """Joints, limits and kinematics of a robot, a tree of links.

    Configurations have one number for each of n driven joints, in a fixed order. Mimic joints follow theirs; all other
    joints are at 0, or at the limit nearest to 0.

    Args:
        urdf_path: The URDF; the meshes that it names need not be there.
        joint_names: The n driven joints; by default all joints with one axis that do not mimic another.

    Attributes:
        urdf_path: The URDF.
        document: The URDF, read.
        all_joints: All joints by name.
        joint_names: The n driven joints.
        joints: Their descriptions.
        limits: Their limits.
        links: Names of all links.
        root: Name of the link that is no joint's child.

    Raises:
        ConfigError: If the description cannot be read, or a joint makes no sense.
        UnknownNameError: If a joint is not known, or does not move by itself.
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
        """Names of the fixed joints; joint states may include them."""
        return frozenset(name for name, joint in self.all_joints.items() if joint.type == "fixed")

    @cached_property
    def telescopic(self) -> tuple[str, ...]:
        """Names of the driven prismatic joints that move links which other driven joints turn."""
        return tuple(dict.fromkeys(name for link in self.links for name in self._telescopic_to(link)))

    @cached_property
    def frames(self) -> LinkFrames:
        """Frames of all links."""
        return LinkFrames(self.all_joints.values(), self.map_to)

    def map_to(self, names: Sequence[str]) -> AffineMap:
        """Returns the map from the n driven joints to some joints, by their names."""
        driven = frozenset(self.joint_names)
        still = {name: joint.rest for name, joint in self.all_joints.items() if name not in driven}
        return AffineMap.of(names, self.joint_names, self.document.mimics, still)

    def pose(self, positions: Sequence[float], link: str, base: str | None = None) -> Pose:
        """Returns the pose of a link in another one, by default the root.

        Args:
            positions: n positions [rad or m].
            link: The link.
            base: The other link.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If there are not n finite positions.
        """
        q = finite_vector(positions, len(self.joint_names), "positions")[None]
        poses = []
        for name in (self.root if base is None else base, link):
            frame, in_frame = self.frames.place(self.check_link(name))
            position, quat = pose_of(self.frames.at(q)[0, frame] @ in_frame)
            poses.append(Pose(tuple(position.tolist()), tuple(quat.tolist())))
        return poses[0].inverse() @ poses[1]

    def check_link(self, name: str) -> str:
        """Returns the name of a link.

        Raises:
            UnknownNameError: If there is no such link.
        """
        if name not in self.links:
            raise UnknownNameError("link", name, self.links)
        return name

    def chain(self, link: str) -> list[UrdfJoint]:
        """Returns the joints from the root to a link."""
        joints = []
        while link != self.root:
            joints.append(self._above[link])
            link = joints[-1].parent
        return joints[::-1]

    def reach(self, link: str, radius_m: float, other: str | None = None) -> Array:
        """Returns upper bounds of the distances that n joints move any point of a link in another link.

        Each bound is for a motion of its joint by 1 rad or 1 m.

        Args:
            link: The link.
            radius_m: Distance of the farthest point of its shape from its origin [m].
            other: The other link, by default the root; joints above both have no effect.

        Raises:
            ConfigError: If a distance has no bound.
        """
        factors, _ = self._joint_motions
        common = {joint.name for joint in self.chain(self.root if other is None else other)}
        reach, beyond = np.zeros(len(self.joint_names)), radius_m
        for joint in reversed(self.chain(link)):
            if joint.name in common:
                break
            if joint.is_moving:
                moved = factors[joint.name].nonzero()  # the others are not needed, even if they have no limits
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
        """Absolute values of the map to joints that move: by name, its n factors and its offset [rad or m]."""
        moving = [joint.name for joint in self.all_joints.values() if joint.is_moving]
        factors, offsets = self.map_to(moving)
        return dict(zip(moving, np.abs(factors))), dict(zip(moving, np.abs(offsets).tolist()))

    def _travel(self, name: str) -> float:
        """Returns the largest distance of a joint from its position 0 [rad or m]."""
        factors, offsets = self._joint_motions
        farthest = (max(abs(joint.lower), abs(joint.upper)) + MAX_OUTSIDE for joint in self.joints)
        travels = (factor * most for factor, most in zip(factors[name].tolist(), farthest) if factor)
        return offsets[name] + sum(travels)

    def _telescopic_to(self, link: str) -> list[str]:
        """Returns the names of the driven joints that slide a link which other driven joints turn."""
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
