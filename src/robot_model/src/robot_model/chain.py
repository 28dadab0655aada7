"""The chain of joints between two links of a robot."""

import math
from collections.abc import Sequence
from functools import cached_property, reduce

import numpy as np

from custom_ros_tools.errors import UnknownNameError

from .frames import origin_of
from .joint_map import AffineMap, followed
from .limits import Limits
from .model import read_robot
from .reach import Reach
from .urdf.copies import chain_urdf
from .urdf.document import UrdfDocument
from .urdf.elements import UrdfJoint


class Chain:
    """The joints between two links, read from a URDF.

    Args:
        urdf_filename: Path of the robot's URDF; its meshes need not exist.
        base: Link where the chain begins, an ancestor of `tip`.
        tip: Link where the chain ends.

    Attributes:
        joints: All joints of the chain, fixed joints included, from the base to the tip.
        moving: The joints of the chain that are not fixed.
        joint_names: Names of the n joints to solve for: the moving joints, with each mimic joint replaced by the joint
            that it follows.
        to_moving: The map from positions of the n joints to positions of the moving joints.
        limits: Limits of the n joints, narrowed so that mimic joints stay within their own limits.
        velocity_limits: Largest speeds of the n joints [rad/s or m/s]; inf for joints without a speed limit.
        robot_joints: Names of all joints of the robot.
        mimics: Names of the chain's mimic joints.

    Raises:
        ConfigError: If the file cannot be read, or a joint is invalid.
        UnknownNameError: If the robot does not have the link `base` or `tip`.
        ValueError: If `base` is not an ancestor of `tip`, or the chain does not have a moving joint. Also if a joint
            is of another type than revolute, continuous, prismatic or fixed, or if a mimic joint is unsuitable: it
            follows a joint that does not move, or its limits exclude all positions of the followed joint.
    """

    def __init__(self, urdf_filename: str, base: str, tip: str) -> None:
        document = read_robot(urdf_filename, "expected well-formed XML")
        for name in (base, tip):
            if name not in document.links:
                raise UnknownNameError("link", name, document.links)
        robot = document.joints
        self.base, self.tip = base, tip
        self.joints = _between(document, base, tip)
        self.moving = tuple(joint for joint in self.joints if joint.is_moving)
        self.joint_names = tuple(dict.fromkeys(_leader(document, joint) for joint in self.moving))
        self.to_moving = AffineMap.of([joint.name for joint in self.moving], self.joint_names, document.mimics)
        self.limits = _limits([robot[name] for name in self.joint_names], self.moving, self.to_moving)
        self.velocity_limits = tuple(robot[name].max_velocity for name in self.joint_names)
        self.robot_joints = frozenset(robot)
        self.mimics = [joint.name for joint in self.joints if joint.mimic is not None]

    @cached_property
    def reach(self) -> Reach:
        """Ball around the first moving joint that contains all reachable tip positions, in the base frame."""
        first = self.joints.index(self.moving[0])
        x, y, z = reduce(np.matmul, map(origin_of, self.joints[: first + 1]))[:3, 3].tolist()
        return Reach.of((x, y, z), [math.hypot(*joint.xyz) for joint in self.joints[first + 1 :]], self.moving)

    @property
    def urdf(self) -> str:
        """Text of a URDF that contains only the chain, with empty links."""
        return chain_urdf(self.joints)


def _between(document: UrdfDocument, base: str, tip: str) -> tuple[UrdfJoint, ...]:
    joints: list[UrdfJoint] = []
    above = document.joints_above(tip)
    while (joints[-1].parent if joints else tip) != base:
        name, kind, _ = next(above, ("", "", ""))
        if not name:
            passed = ", ".join(joint.parent for joint in joints) or "no links"
            raise ValueError(f"'{tip}' is not below '{base}'; above it are {passed}")
        joints.append(document.joints[name])
        if not joints[-1].is_moving and kind != "fixed":
            kinds = "only revolute, continuous, prismatic and fixed ones are solved for"
            raise ValueError(f"'{tip}' is below '{name}', a {kind} joint; {kinds}")
    if not any(joint.is_moving for joint in joints):
        raise ValueError(f"no joint moves '{tip}' in '{base}'")
    return tuple(joints[::-1])


def _leader(document: UrdfDocument, joint: UrdfJoint) -> str:
    """Returns the name of the joint that a mimic joint follows; for any other joint, the joint's own name."""
    if joint.mimic is None:
        return joint.name
    leader = followed(joint.name, document.mimics).joint
    if leader not in document.joints or not document.joints[leader].is_moving:
        raise ValueError(f"joint '{joint.name}' mimics '{leader}', which is no joint that moves by itself")
    return leader


def _limits(leaders: Sequence[UrdfJoint], moving: Sequence[UrdfJoint], to_moving: AffineMap) -> Limits:
    lower, upper = [joint.lower for joint in leaders], [joint.upper for joint in leaders]
    for joint, factors, offset in zip(moving, to_moving.factors.tolist(), to_moving.offsets.tolist()):
        ((i, multiplier),) = ((i, factor) for i, factor in enumerate(factors) if factor)
        ends = sorted((limit - offset) / multiplier for limit in (joint.lower, joint.upper))
        lower[i], upper[i] = max(lower[i], ends[0]), min(upper[i], ends[1])
        if lower[i] > upper[i]:
            name = leaders[i].name
            raise ValueError(f"joint '{joint.name}' leaves '{name}', which it mimics, no position within limits")
    return Limits(lower, upper, [joint.is_revolute for joint in leaders])
