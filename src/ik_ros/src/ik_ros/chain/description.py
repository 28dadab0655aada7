"""What lies between two links of a robot, read from its URDF."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from custom_ros_tools.errors import UnknownNameError
from rpbi.kinematics.limits import Limits
from rpbi.urdf.copies import chain_urdf
from rpbi.urdf.document import UrdfDocument
from rpbi.urdf.elements import UrdfJoint
from rpbi.urdf.structure import check_structure


class Drive(NamedTuple):
    """What moves a joint of a chain: a variable that is solved for.

    Attributes:
        variable: Which of the n variables.
        multiplier: The joint's position is this times the variable...
        offset: ... plus this [rad or m].
    """

    variable: int
    multiplier: float = 1.0
    offset: float = 0.0


class ChainDescription:
    """The joints between two links, read from a URDF.

    Args:
        urdf_filename: The robot's URDF; the meshes it names need not be there.
        base: The link where the chain begins.
        tip: The link where it ends; the base is above it.

    Attributes:
        joints: All joints in between, fixed ones too, from the base to the tip.
        moving: Those of them that are not fixed.
        drives: What moves each of these.
        joint_names: The n joints that are solved for: those that move, and in the place of joints that mimic another
            that other one.
        limits: Their limits, within which joints that mimic them are within theirs too.
        velocity_limits: Their largest speeds [rad/s or m/s], inf where there is none.
        robot_joints: All joints of the robot.
        mimics: Names of the chain's joints that mimic others.

    Raises:
        ConfigError: If the file cannot be read.
        UnknownNameError: If a link is not known.
        ValueError: If the chain cannot be solved for; it names the joint or link.
    """

    def __init__(self, urdf_filename: str, base: str, tip: str) -> None:
        document = UrdfDocument(urdf_filename, not_xml="expected well-formed XML")
        check_structure(document)
        for name in (base, tip):
            if name not in document.links:
                raise UnknownNameError("link", name, document.links)
        robot = document.joints
        self.base, self.tip = base, tip
        self.joints = _between(document, base, tip)
        self.moving = tuple(joint for joint in self.joints if joint.is_moving)
        self.joint_names, self.drives = _drives(robot, self.moving)
        self.limits = _limits([robot[name] for name in self.joint_names], self.moving, self.drives)
        self.velocity_limits = tuple(robot[name].max_velocity for name in self.joint_names)
        self.robot_joints = frozenset(robot)
        self.mimics = [joint.name for joint in self.joints if joint.mimic is not None]

    @property
    def urdf(self) -> str:
        """A URDF of the chain alone, of bare links and joints."""
        return chain_urdf(self.joints)


def _between(document: UrdfDocument, base: str, tip: str) -> tuple[UrdfJoint, ...]:
    joints: list[UrdfJoint] = []
    above = document.joints_above(tip)
    while (joints[-1].parent if joints else tip) != base:
        name, kind, _ = next(above, ("", "", ""))
        if not name:
            passed = ", ".join(joint.parent for joint in joints) or "no links"
            raise ValueError(f"'{tip}' does not hang on '{base}'; above it are {passed}")
        joints.append(document.joints[name])
        if not joints[-1].is_moving and kind != "fixed":
            kinds = "only revolute, continuous, prismatic and fixed ones are solved for"
            raise ValueError(f"'{tip}' hangs on '{name}', a {kind} joint; {kinds}")
    if not any(joint.is_moving for joint in joints):
        raise ValueError(f"no joint moves '{tip}' in '{base}'")
    return tuple(joints[::-1])


def _drives(robot: Mapping[str, UrdfJoint], moving: Sequence[UrdfJoint]) -> tuple[tuple[str, ...], tuple[Drive, ...]]:
    """Returns the joints to solve for, and what moves each joint of the chain."""
    names: list[str] = []
    drives = []
    for joint in moving:
        leader, *line = joint.mimic or (joint.name,)
        if joint.mimic and (leader not in robot or robot[leader].mimic or not robot[leader].is_moving):
            raise ValueError(f"joint '{joint.name}' mimics '{leader}', which is no joint that moves by itself")
        if leader not in names:
            names.append(leader)
        drives.append(Drive(names.index(leader), *line))
    return tuple(names), tuple(drives)


def _limits(leaders: Sequence[UrdfJoint], moving: Sequence[UrdfJoint], drives: Sequence[Drive]) -> Limits:
    lower, upper = [joint.lower for joint in leaders], [joint.upper for joint in leaders]
    for joint, (i, multiplier, offset) in zip(moving, drives):
        ends = sorted((limit - offset) / multiplier for limit in (joint.lower, joint.upper))
        lower[i], upper[i] = max(lower[i], ends[0]), min(upper[i], ends[1])
        if lower[i] > upper[i]:
            name = leaders[i].name
            raise ValueError(f"joint '{joint.name}' leaves '{name}', which it mimics, no position within limits")
    return Limits(lower, upper, [joint.is_revolute for joint in leaders])
