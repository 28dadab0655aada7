"""Where a link shall be, and how far off it may be."""

from __future__ import annotations

import math

import PyKDL

from ik_ros.problem import IKProblem
from rpbi.kinematics.residual import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, Residual


class Goal:
    """A target with a box of tolerances around it.

    Args:
        problem: The question.

    Attributes:
        frame: The target in the base.
        inverse: The base in the target.
        tolerance: How far off the link may be: 3 ways along the axes of the target [m], and 3 components of the
            rotation vector from the target to the link, in the target [rad]; inf where any will do.
        is_point: Whether the box is no larger than what counts as reached anyway.

    Raises:
        ValueError: If the problem has no target.
    """

    def __init__(self, problem: IKProblem) -> None:
        if problem.target is None:
            raise ValueError("target: missing; this solver moves one link to a pose")
        position, quat_xyzw = problem.target
        self.frame = PyKDL.Frame(PyKDL.Rotation.Quaternion(*quat_xyzw), PyKDL.Vector(*position))
        self.inverse = self.frame.Inverse()
        turns = (math.inf if angle >= math.pi else angle for angle in problem.rotation_tolerance)
        self.tolerance = (*problem.position_tolerance, *turns)
        self.is_point = (
            max(problem.position_tolerance) <= POSITION_TOLERANCE_M
            and max(problem.rotation_tolerance) <= ORIENTATION_TOLERANCE_RAD
        )

    @property
    def any_orientation(self) -> bool:
        """Whether the link may be turned as it likes."""
        return min(self.tolerance[3:]) == math.inf

    def off(self, frame: PyKDL.Frame) -> list[float]:
        """Returns how far a link is off: 3 ways [m] and a rotation vector [rad], in the target.

        Args:
            frame: Where the link is in the base.
        """
        difference = self.inverse * frame
        p, turn = difference.p, difference.M.GetRot()
        return [p[0], p[1], p[2], turn[0], turn[1], turn[2]]

    def beyond(self, off: list[float]) -> list[float]:
        """Returns what of these 6 values is beyond the tolerances."""
        return [math.copysign(max(abs(value) - tolerance, 0.0), value) for value, tolerance in zip(off, self.tolerance)]

    def residual(self, frame: PyKDL.Frame) -> Residual:
        """Returns how far a link is off beyond the tolerances.

        Args:
            frame: Where the link is in the base.
        """
        x, y, z, rx, ry, rz = self.beyond(self.off(frame))
        return Residual(math.hypot(x, y, z), math.hypot(rx, ry, rz))


def refuse_boxes(problem: IKProblem, solver: str, may_turn: bool = False) -> None:
    """Refuses tolerances that are larger than what counts as reached anyway.

    Args:
        problem: The question.
        solver: Name of the solver that cannot make use of them.
        may_turn: Whether it can make use of those for rotations.

    Raises:
        ValueError: If there are some; it names the field.
    """
    limits = [("position_tolerance", POSITION_TOLERANCE_M), ("rotation_tolerance", ORIENTATION_TOLERANCE_RAD)]
    for name, most in limits[:1] if may_turn else limits:
        values = getattr(problem, name)
        if max(values) > most:
            advice = "the solver 'kdl' makes use of them"
            raise ValueError(f"{name}: '{solver}' takes none above {most:g}, got {values}; {advice}")
