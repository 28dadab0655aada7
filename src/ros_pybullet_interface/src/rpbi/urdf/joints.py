"""Joints of a robot, with their PyBullet indices and the couplings of mimic joints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import pybullet

from custom_ros_tools.errors import UnknownNameError
from robot_model.joint_map import AffineMap, followed
from robot_model.limits import LIMIT_ROUNDING, MAX_MAGNITUDE
from robot_model.urdf.elements import Mimic
from rpbi.engine.client import Client

_TYPES = ("JOINT_REVOLUTE", "JOINT_PRISMATIC", "JOINT_SPHERICAL", "JOINT_PLANAR", "JOINT_FIXED")
_TYPE_NAMES = {getattr(pybullet, name): name for name in _TYPES}


_COUPLING_EFFORT = 1e6
"""Largest effort [N m or N] of the constraint that makes a mimic joint follow its leader."""
_COUPLING_ERP = 1.0
"""Error reduction parameter of this constraint: share of the position error that is corrected in a step."""


@dataclass(frozen=True)
class Joint:
    """A joint as PyBullet has read it from the URDF.

    Attributes:
        index: PyBullet's index of the joint and of its child link.
        name: Name of the joint.
        type: PyBullet's joint type.
        link: Name of the child link.
        lower: Lower position limit [rad or m]; -inf without a limit.
        upper: Upper position limit [rad or m]; inf without a limit.
        max_effort: Maximum torque or force [N m or N]; inf without a limit.
        max_velocity: Maximum speed [rad/s or m/s]; inf without a limit.
    """

    index: int
    name: str
    type: int
    link: str
    lower: float
    upper: float
    max_effort: float
    max_velocity: float

    @classmethod
    def from_info(cls, info: Sequence) -> Joint:
        """Returns a joint from the result of PyBullet's `getJointInfo`.

        Effort 0 means no effort limit, and velocity 0 no speed limit. A lower position limit that is not below the
        upper position limit means that the joint does not have position limits.
        """
        limited = info[8] < info[9]
        return cls(
            index=info[0],
            name=info[1].decode(),
            type=info[2],
            link=info[12].decode(),
            lower=info[8] if limited else -math.inf,
            upper=info[9] if limited else math.inf,
            max_effort=info[10] if info[10] > 0 else math.inf,
            max_velocity=info[11] if info[11] > 0 else math.inf,
        )

    @classmethod
    def all_of(cls, pb: Client, body_id: int) -> list[Joint]:
        """Returns the joints of a body in PyBullet's index order."""
        return [cls.from_info(pb.getJointInfo(body_id, index)) for index in range(pb.getNumJoints(body_id))]

    @property
    def type_name(self) -> str:
        """PyBullet's name of the joint type, such as `JOINT_REVOLUTE`."""
        return _TYPE_NAMES.get(self.type, str(self.type))

    @property
    def is_revolute(self) -> bool:
        """Whether the joint turns about one axis, with or without limits."""
        return self.type == pybullet.JOINT_REVOLUTE

    @property
    def is_fixed(self) -> bool:
        """Whether the joint is fixed."""
        return self.type == pybullet.JOINT_FIXED

    @property
    def unit(self) -> str:
        """Unit of the joint's position: `m` or `rad`."""
        return "m" if self.type == pybullet.JOINT_PRISMATIC else "rad"

    def allows(self, position: float) -> bool:
        """Returns whether a position [rad or m] is within the limits, with a tolerance for rounded limits."""
        return self.lower - LIMIT_ROUNDING <= position <= self.upper + LIMIT_ROUNDING

    def nearest_allowed(self, position: float) -> float:
        """Returns a position [rad or m], clipped to the limits."""
        return min(max(position, self.lower), self.upper)

    def limit_violation(self, position: float) -> str:
        """Returns the error message for a position [rad or m] that is outside the limits."""
        limits = f"{self.lower:.6g} to {self.upper:.6g} {self.unit}"
        return f"joint '{self.name}' must be within {limits}, got {position:.6g}"

    @property
    def is_driven(self) -> bool:
        """Whether the joint is revolute or prismatic. Only such joints can have motors."""
        return self.type in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC)


class Coupling(NamedTuple):
    """Relation of a mimic joint to its leader: position = multiplier * (position of the leader) + offset.

    Attributes:
        leader: PyBullet's index of the leader, which is not a mimic joint itself.
        multiplier: Ratio of the mimic joint's velocity to the leader's velocity.
        offset: Position [rad or m] of the mimic joint when the leader's position is 0.
    """

    leader: int
    multiplier: float
    offset: float


class JointModel:
    """The joints of one robot, accessible by PyBullet's index and by name.

    Args:
        joints: All joints in the order of PyBullet's indices.
        base_joints: Number of joints at the beginning of `joints` that move the robot's base. These joints are not part
            of the robot itself.
        mimics: Mimic joints, indexed by name.

    Attributes:
        joints: All joints, including the joints that move the base.
        own: Joints of the robot itself.
        moving: The revolute and prismatic joints in `own`.
        couplings: Couplings of mimic joints, indexed by PyBullet's joint index.
        driven: The joints in `moving` that motors drive: all except mimic joints.

    Raises:
        ValueError: If a mimic joint cannot follow its leader; the message names the joint.
    """

    def __init__(
        self, joints: Sequence[Joint], base_joints: int = 0, mimics: Mapping[str, Mimic] = MappingProxyType({})
    ) -> None:
        self.joints = tuple(joints)
        self.own = self.joints[base_joints:]
        self.moving = tuple(joint for joint in self.own if joint.is_driven)
        self._by_name = {joint.name: joint for joint in self.own}
        mimics = {name: mimic for name, mimic in mimics.items() if name in self._by_name and self[name].is_driven}
        self.couplings = {self[name].index: self._coupling(name, mimics) for name in mimics}
        self.driven = tuple(joint for joint in self.moving if joint.index not in self.couplings)
        self._mimics = mimics

    @cached_property
    def by_driven(self) -> AffineMap:
        """Affine map from positions of the joints in `driven` to positions of the joints in `moving`."""
        names, driven = ([joint.name for joint in joints] for joints in (self.moving, self.driven))
        return AffineMap.of(names, driven, self._mimics)

    def __getitem__(self, name: str) -> Joint:
        """Returns the joint with a given name.

        Raises:
            UnknownNameError: If the robot has no such joint.
        """
        try:
            return self._by_name[name]
        except KeyError:
            raise UnknownNameError("joint", name, list(self._by_name)) from None

    def _coupling(self, name: str, mimics: Mapping[str, Mimic]) -> Coupling:
        """Returns the coupling of a mimic joint to the leader at the end of a chain of mimic joints."""
        leader, multiplier, offset = followed(name, mimics)
        if leader not in self._by_name or not self[leader].is_driven:
            movable = ", ".join(joint.name for joint in self.moving)
            raise ValueError(
                f"joint '{name}' follows '{leader}', which is no moving joint; moving joints are {movable}"
            )
        return Coupling(self[leader].index, multiplier, offset)

    def effort_limit(self, joint: Joint) -> float:
        """Returns the maximum effort [N m or N] of a driven joint's motor.

        The motor also drives the mimic joints that follow the joint. Therefore, the maximum efforts of these mimic
        joints are added, each multiplied by the absolute value of the coupling's multiplier.
        """
        return joint.max_effort + sum(
            abs(multiplier) * self.joints[index].max_effort
            for index, (leader, multiplier, _) in self.couplings.items()
            if leader == joint.index
        )

    def with_mimic_joints(self, positions: Mapping[int, float], offsets: bool = True) -> dict[int, float]:
        """Computes the values of mimic joints from the values of their leaders.

        Args:
            positions: Positions [rad or m] or velocities [rad/s or m/s], indexed by PyBullet's joint index.
            offsets: True adds the offsets of couplings, as needed for positions; False is for velocities.

        Returns:
            The values in `positions`, and the values of the mimic joints whose leaders are in `positions`.
        """
        followers = {
            index: multiplier * positions[leader] + (offset if offsets else 0.0)
            for index, (leader, multiplier, offset) in self.couplings.items()
            if leader in positions
        }
        return {**positions, **followers}

    def resolve(self, names: Sequence[str], values: Sequence[float]) -> dict[int, float]:
        """Checks values of joints, and returns the values of the driven joints, indexed by PyBullet's joint index.

        Values of other joints, such as fixed joints and mimic joints, are accepted but left out of the result.

        Args:
            names: Names of the joints.
            values: Value of each joint, in the order of `names`.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: If lengths differ, a joint is named twice, or a value is too large or not finite.
        """
        if len(names) != len(values):
            raise ValueError(f"expected one value for each of the {len(names)} joints named, got {len(values)}")
        if len(set(names)) != len(names):
            raise ValueError(f"joints must be named once each, got {', '.join(names)}")
        resolved: dict[int, float] = {}
        for name, value in zip(names, values, strict=True):
            joint = self[name]
            if not math.isfinite(value):
                raise ValueError(f"values must be finite, got {value} for joint '{name}'")
            if abs(value) > MAX_MAGNITUDE:
                raise ValueError(f"values must be within +-{MAX_MAGNITUDE:g}, got {value:g} for joint '{name}'")
            if joint.is_driven and joint.index not in self.couplings:
                resolved[joint.index] = float(value)
        return resolved

    def resolve_driven(self, names: Sequence[str], values: Sequence[float]) -> dict[int, float]:
        """Checks and converts values as `resolve` does; also requires that at least one of the named joints is driven.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: See `resolve`; also if joints are named and none of them is driven.
        """
        resolved = self.resolve(names, values)
        if names and not resolved:
            others = ", ".join(f"'{name}' ({self._why_undriven(self[name])})" for name in names)
            raise ValueError(f"expected joints that can be driven, got {others}")
        return resolved

    def _why_undriven(self, joint: Joint) -> str:
        coupling = self.couplings.get(joint.index)
        return joint.type_name if coupling is None else f"follows '{self.joints[coupling.leader].name}'"

    def check_limits(self, positions: Mapping[int, float]) -> None:
        """Checks that positions [rad or m], indexed by PyBullet's joint index, are within the joint limits.

        Raises:
            ValueError: If a position is outside the limits; the message names all such positions.
        """
        if beyond := self.limit_violations(positions):
            raise ValueError("; ".join(beyond))

    def limit_violations(self, positions: Mapping[int, float]) -> list[str]:
        """Returns a message for each position outside the limits of its joint.

        Args:
            positions: Positions [rad or m], indexed by PyBullet's joint index.
        """
        return [
            self.joints[index].limit_violation(position)
            for index, position in positions.items()
            if not self.joints[index].allows(position)
        ]


def couple(pb: Client, body_id: int, couplings: Mapping[int, Coupling]) -> None:
    """Adds gear constraints that make mimic joints follow their leaders, and disables the mimic joints' motors.

    Args:
        pb: Client of the body.
        body_id: PyBullet's id of the body.
        couplings: Couplings, indexed by PyBullet's index of the mimic joint.
    """
    for index, (leader, multiplier, offset) in couplings.items():
        pb.setJointMotorControl2(body_id, index, pybullet.VELOCITY_CONTROL, force=0.0)
        gear = pb.createConstraint(
            body_id, index, body_id, leader, pybullet.JOINT_GEAR, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        )
        pb.changeConstraint(
            gear, gearRatio=-multiplier, relativePositionTarget=offset, erp=_COUPLING_ERP, maxForce=_COUPLING_EFFORT
        )
