"""Answers of inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class IKSolution:
    """Where inverse kinematics got to.

    Attributes:
        success: Whether the link is within 1 mm and, if an orientation was asked for, 0.01 rad of its target.
        message: How far off it is, in words.
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
