"""Problems of inverse kinematics as PyBullet has them, and their solutions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pybullet

from robot_model.limits import MAX_MAGNITUDE, Limits

_NULL_SPACE = ("lowerLimits", "upperLimits", "jointRanges", "resetPoses")
_PER_JOINT = (*_NULL_SPACE, "jointDamping", "currentPosition")


@dataclass(frozen=True)
class PybulletProblem:
    """Target pose of a link of a robot, and parameters of the search for it.

    The fields are those of the message `CalculateInverseKinematicsProblem`, without the frame. "Each joint" is each
    joint that a motor can move, in the robot's order; the solver chooses values that are empty or 0.

    Attributes:
        link_name: The link, by its name in the URDF; not the root.
        targetPosition: x, y, z of the link's URDF frame in the frame of the robot's base link [m].
        targetOrientation: Its quaternion x, y, z, w in the same frame, of any length but 0; empty: any orientation.
        lowerLimits: Lower limit of each joint [rad or m]. They narrow those of the URDF and never widen them.
        upperLimits: Upper limit of each joint [rad or m].
        jointRanges: Range of each joint about its rest posture, relative to the others [rad or m].
        resetPoses: Rest posture of each joint, to be near as the target allows [rad or m]. These four go together.
        jointDamping: Weight of the motion of each joint, relative to the others.
        solver: 0 damped least squares, 1 selectively damped least squares.
        currentPosition: Start of the search, for each joint [rad or m]; joints that do not move the link stay.
        maxNumIterations: Most iterations from one start.
        residualThreshold: Distance at which the search stops [m], 1 mm at most; as angle [rad], it counts ten times.

    Raises:
        ValueError: If a field is invalid; it names the field.
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
        """Checks that lists with a value for each joint have one for each of these.

        Raises:
            ValueError: If one has not.
        """
        for field in _PER_JOINT:
            length = len(getattr(self, field))
            if length not in (0, len(joint_names)):
                expected = f"{len(joint_names)} values, one for each of {', '.join(joint_names)}"
                raise ValueError(f"{field}: expected {expected}; got {length}")

    def narrowed(self, limits: Limits, joint_names: Sequence[str]) -> Limits:
        """Returns limits of joints with those of the problem, if it has any, inside them.

        A lower limit above the upper one means none, as it does in PyBullet, where the URDF has none either.

        Raises:
            ValueError: If a joint is left without any position; it names the joint.
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
        success: Whether the link is within 1 mm and, if an orientation was asked for, 0.01 rad of its target.
        message: Description of the error.
        joint_names: n joints that a motor can move, in the robot's order.
        positions: n positions [rad or m]; without success, the best that were found.
        chain: Those of the joints that move the link, within their limits; the others are where they were.
        position_error_m: Distance that is left [m].
        orientation_error_rad: Angle that is left [rad]; 0 if no orientation was asked for.
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
        """Positions of the joints that move the link [rad or m], in the order of `chain`."""
        by_name = dict(zip(self.joint_names, self.positions))
        return tuple(by_name[name] for name in self.chain)
