"""Answers of inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass

from rpbi.pose import Pose


@dataclass(frozen=True)
class JointTrajectory:
    """Positions of n joints over time.

    Attributes:
        times_s: m times from the start [s], increasing.
        positions: For each of them, n positions [rad or m].
        velocities: For each of them, n velocities [rad/s or m/s].
    """

    times_s: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    velocities: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class IKSolution:
    """Where a solver got to.

    Attributes:
        success: Whether all that was asked for is met within the tolerances, and the limits are held.
        message: How well it went, or why not, in words with numbers.
        joint_names: The solver's n joints, always in the same order.
        positions: n positions within limits [rad or m]; without success, the best that were found, and without any
            of those, where the search started.
        position_error_m: How far the link is off its target beyond the tolerance [m]; for several, the largest.
        orientation_error_rad: How far it is turned beyond the tolerance [rad]; for several, the largest.
        alternatives: Other solutions, the best first, of solvers that look for more than one; n positions each.
        trajectory: Of solvers of trajectories; `positions` are then its last ones.
        base_pose: Of robots whose root floats: where it is then in the solver's base frame.
    """

    success: bool
    message: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]
    position_error_m: float = 0.0
    orientation_error_rad: float = 0.0
    alternatives: tuple[tuple[float, ...], ...] = ()
    trajectory: JointTrajectory | None = None
    base_pose: Pose | None = None
