"""Problems of inverse kinematics with PyBullet's parameters, and their solutions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pybullet

from robot_model.limits import MAX_MAGNITUDE, Limits

_NULL_SPACE = ("lowerLimits", "upperLimits", "jointRanges", "resetPoses")
_PER_JOINT = (*_NULL_SPACE, "jointDamping", "currentPosition")


@dataclass(frozen=True)
class PybulletProblem:
    """Target pose of a link of a robot, and parameters of the search for joint positions.

    The fields are those of the message `CalculateInverseKinematicsProblem`, except `header`. Lists per joint have
    one value for each of the n joints that motors can move, in the robot's order. The solver replaces fields that are
    empty or 0 by defaults. `lowerLimits`, `upperLimits`, `jointRanges` and `resetPoses` must be given together.

    Attributes:
        link_name: Name of the link in the URDF; not the root link.
        targetPosition: Target x, y, z [m] of the link's URDF frame, in the frame of the robot's base link.
        targetOrientation: Target quaternion x, y, z, w in the same frame, not necessarily of length 1. Empty accepts
            any orientation.
        lowerLimits: n lower limits [rad or m], which narrow the URDF's limits but never widen them.
        upperLimits: n upper limits [rad or m], which never widen the URDF's limits either.
        jointRanges: n ranges [rad or m]. The wider a joint's range is relative to others, the farther the joint may be
            from its rest position.
        resetPoses: n positions of the rest posture [rad or m]; the solution is as near to the posture as possible.
        jointDamping: n relative dampings. A joint with a larger damping moves less.
        solver: 0 for damped least squares, 1 for selectively damped least squares.
        currentPosition: n start positions [rad or m]. Joints that do not move the link keep these positions.
        maxNumIterations: Maximum number of iterations from one start.
        residualThreshold: Distance [m] at which the search stops, at most 1 mm. Ten times this number is the threshold
            of the angle [rad].

    Raises:
        ValueError: If a field is invalid. The message names the field.
    """

    link_name: str
    targetPosition: Sequence[float]
    targetOrientation: Sequence[float] = ()
    lowerLimits: Sequence[float] = ()
    upperLimits: Sequence[float] = ()
    jointRanges: Sequence[float] = ()
    resetPoses: Sequence[float] = ()
    jointDamping: Sequence[float] = ()
    solver: int = pybullet.IK_DLS
    currentPosition: Sequence[float] = ()
    maxNumIterations: int = 0
    residualThreshold: float = 0.0

    def __post_init__(self) -> None:
        for field in ("targetPosition", "targetOrientation", *_PER_JOINT):
            values = tuple(map(float, getattr(self, field)))
            if not all(abs(value) <= MAX_MAGNITUDE for value in values):
                raise ValueError(f"{field}: values must be finite, {MAX_MAGNITUDE:g} at most; got {_shown(values)}")
            object.__setattr__(self, field, values)  # arrays and lists become tuples
        if len(self.targetPosition) != 3:
            raise ValueError(f"targetPosition: expected 3 values, got {len(self.targetPosition)}")
        if len(self.targetOrientation) not in (0, 4):
            raise ValueError(f"targetOrientation: expected 4 values or none, got {len(self.targetOrientation)}")
        if self.targetOrientation and math.hypot(*self.targetOrientation) < 1e-6:
            raise ValueError(f"targetOrientation: must not be zero, got {_shown(self.targetOrientation)}")
        missing = [field for field in _NULL_SPACE if not getattr(self, field)]
        if missing and len(missing) < len(_NULL_SPACE):
            raise ValueError(f"{', '.join(missing)}: missing; {', '.join(_NULL_SPACE)} go together")
        if any(value < 0 for value in self.jointDamping):
            raise ValueError(f"jointDamping: values must not be negative, got {_shown(self.jointDamping)}")
        if self.solver not in (pybullet.IK_DLS, pybullet.IK_SDLS):
            raise ValueError(f"solver: expected 0 (damped) or 1 (selectively damped), got {self.solver}")
        if self.maxNumIterations < 0:
            raise ValueError(f"maxNumIterations: must not be negative, got {self.maxNumIterations}")
        if not (math.isfinite(self.residualThreshold) and self.residualThreshold >= 0):
            raise ValueError(f"residualThreshold: must not be negative, got {self.residualThreshold}")

    def check_lengths(self, joint_names: Sequence[str]) -> None:
        """Checks the lengths of the lists that have one value per joint.

        Args:
            joint_names: Names of the n joints.

        Raises:
            ValueError: If a non-empty list does not have length n.
        """
        for field in _PER_JOINT:
            length = len(getattr(self, field))
            if length not in (0, len(joint_names)):
                expected = f"{len(joint_names)} values, one for each of {', '.join(joint_names)}"
                raise ValueError(f"{field}: expected {expected}; got {length}")

    def narrowed(self, limits: Limits, joint_names: Sequence[str]) -> Limits:
        """Returns the intersection of given joint limits with the problem's limits.

        If a joint has no URDF limits, and the problem's lower limit is above the problem's upper limit, both limits of
        the problem are ignored, as in PyBullet.

        Args:
            limits: URDF limits of the n joints.
            joint_names: Names of the n joints.

        Raises:
            ValueError: If the intersection is empty for a joint. The message names the joint.
        """
        lower, upper = list(limits.lower), list(limits.upper)
        for i, (name, least, most) in enumerate(zip(joint_names, self.lowerLimits, self.upperLimits)):
            if least > most and (lower[i], upper[i]) == (-math.inf, math.inf):
                continue
            urdf = f"the URDF has {lower[i]:g} to {upper[i]:g}"
            lower[i], upper[i] = max(least, lower[i]), min(most, upper[i])
            if lower[i] > upper[i]:
                message = f"no position of '{name}' is within {least:g} to {most:g} ({urdf})"
                raise ValueError(f"lowerLimits, upperLimits: {message}")
        return Limits(lower, upper, limits.is_revolute)


def _shown(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:g}' for value in values)})"


@dataclass(frozen=True)
class PybulletSolution:
    """Result of inverse kinematics.

    Attributes:
        success: Whether the link is within 1 mm of its target and, with a target orientation, within 0.01 rad.
        message: Description of the remaining error.
        joint_names: Names of the n joints that motors can move, in the robot's order.
        positions: n positions [rad or m]; without success, the best positions found. Joints of the chain are within
            their limits; other joints keep their start positions.
        chain: Names of the joints that move the link.
        position_error_m: Remaining distance [m].
        orientation_error_rad: Remaining angle [rad]; 0 without a target orientation.
    """

    success: bool
    message: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]
    chain: tuple[str, ...]
    position_error_m: float
    orientation_error_rad: float

    @property
    def chain_positions(self) -> tuple[float, ...]:
        """Positions [rad or m] of the joints that move the link, in the order of `chain`."""
        by_name = dict(zip(self.joint_names, self.positions))
        return tuple(by_name[name] for name in self.chain)
