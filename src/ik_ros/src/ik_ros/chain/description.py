"""What lies between two links of a robot, read from its URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from custom_ros_tools.errors import UnknownNameError
from rpbi.urdf.document import UrdfDocument, UrdfJoint, chain_urdf


@dataclass(frozen=True)
class Drive:
    """What moves a joint of a chain: a variable that is solved for.

    Attributes:
        variable: Which of the n variables.
        multiplier: The joint's position is this times the variable...
        offset: ... plus this [rad or m].
    """

    variable: int
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class ChainDescription:
    """The joints between two links.

    Attributes:
        base: The link where it begins.
        tip: The link where it ends.
        joints: All joints in between, fixed ones too, from the base to the tip.
        drives: What moves each of those that are not fixed.
        joint_names: The n joints that are solved for: those that move, and in the place of joints that mimic another
            that other one.
        lower: Their lower limits [rad or m], -inf where there is none.
        upper: Their upper limits [rad or m], inf where there is none.
        velocity_limits: Their largest speeds [rad/s or m/s], inf where there is none.
        is_revolute: Which of them turn.
        robot_joints: All joints of the robot.
    """

    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    drives: tuple[Drive, ...]
    joint_names: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    velocity_limits: tuple[float, ...]
    is_revolute: tuple[bool, ...]
    robot_joints: frozenset[str]

    @property
    def mimics(self) -> list[str]:
        """Names of the chain's joints that mimic others."""
        return [joint.name for joint in self.joints if joint.mimic is not None]

    @property
    def urdf(self) -> str:
        """A URDF of the chain alone, of bare links and joints."""
        return chain_urdf(self.joints)


def read_chain(urdf_filename: str, base: str, tip: str) -> ChainDescription:
    """Reads the chain between two links.

    Args:
        urdf_filename: The robot's URDF; the meshes it names need not be there.
        base: The link where it begins.
        tip: The link where it ends; the base is above it.

    Raises:
        ConfigError: If the file cannot be read.
        UnknownNameError: If a link is not known.
        ValueError: If the chain cannot be solved for; it names the joint or link.
    """
    document = UrdfDocument(urdf_filename, not_xml="expected well-formed XML")
    for name in (base, tip):
        if name not in document.links:
            raise UnknownNameError("link", name, document.links)
    robot = document.joints
    joints = _between(document, base, tip)
    names, drives = _drives(robot, joints)
    lower, upper = _limits(robot, joints, names, drives)
    return ChainDescription(
        base=base,
        tip=tip,
        joints=tuple(joints),
        drives=tuple(drives),
        joint_names=tuple(names),
        lower=tuple(lower),
        upper=tuple(upper),
        velocity_limits=tuple(robot[name].max_velocity for name in names),
        is_revolute=tuple(robot[name].is_revolute for name in names),
        robot_joints=frozenset(robot),
    )


def _between(document: UrdfDocument, base: str, tip: str) -> list[UrdfJoint]:
    joints: list[UrdfJoint] = []
    above = document.joints_above(tip)
    while (joints[-1].parent if joints else tip) != base:
        name, kind, _ = next(above, ("", "", ""))
        if not name:
            passed = ", ".join(joint.parent for joint in joints) or "no links"
            raise ValueError(f"'{tip}' does not hang on '{base}'; above it are {passed}")
        joint = document.joints[name]
        if not joint.is_moving and kind != "fixed":
            kinds = "only revolute, continuous, prismatic and fixed ones are solved for"
            raise ValueError(f"'{tip}' hangs on '{name}', a {kind} joint; {kinds}")
        joints.append(joint)
    if not any(joint.is_moving for joint in joints):
        raise ValueError(f"no joint moves '{tip}' in '{base}'")
    return joints[::-1]


def _drives(robot: Mapping[str, UrdfJoint], joints: Sequence[UrdfJoint]) -> tuple[list[str], list[Drive]]:
    """Returns the joints to solve for, and what moves each joint of the chain."""
    names: list[str] = []
    drives = []
    for joint in (joint for joint in joints if joint.is_moving):
        mimic = joint.mimic
        leader = joint.name if mimic is None else mimic.joint
        if mimic is not None and (leader not in robot or robot[leader].mimic or not robot[leader].is_moving):
            raise ValueError(f"joint '{joint.name}' mimics '{leader}', which is no joint that moves by itself")
        if leader not in names:
            names.append(leader)
        variable = names.index(leader)
        drives.append(Drive(variable) if mimic is None else Drive(variable, mimic.multiplier, mimic.offset))
    return names, drives


def _limits(
    robot: Mapping[str, UrdfJoint], joints: Sequence[UrdfJoint], names: Sequence[str], drives: Sequence[Drive]
) -> tuple[list[float], list[float]]:
    """Returns limits of the joints to solve for, within which joints that mimic them are within theirs too."""
    lower, upper = [robot[name].lower for name in names], [robot[name].upper for name in names]
    for joint, drive in zip((joint for joint in joints if joint.is_moving), drives):
        i = drive.variable
        ends = sorted((limit - drive.offset) / drive.multiplier for limit in (joint.lower, joint.upper))
        lower[i], upper[i] = max(lower[i], ends[0]), min(upper[i], ends[1])
        if lower[i] > upper[i]:
            raise ValueError(f"joint '{joint.name}' leaves '{names[i]}', which it mimics, no position within limits")
    return lower, upper
