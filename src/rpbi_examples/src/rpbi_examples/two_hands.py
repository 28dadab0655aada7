"""Two arms whose hands draw mirrored circles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from custom_ros_tools.errors import InterfaceError
from ik_ros.problem import IKProblem
from ik_ros.solvers.kdl import KdlConfig, KdlSolver
from robot_model.geometry import Pose
from rpbi.control.trajectories.trajectory import minimum_jerk

from .motions import CIRCLE_CENTRE, POINTING_DOWN, hand_position

LINK = "lbr_iiwa_link_7"
APPROACH_S = 3.0
"""Time of the motion to the circles [s]."""
RAMP_S = 1.0
"""Time in which the hands reach their speed on the circles [s]."""


class MirroredHands:
    """Joint positions with which the hands of two arms draw mirrored circles, beginning at the present positions.

    Args:
        urdf: File with both arms, whose links and joints begin with the name of the arm.
        arms: Their names, the left one first.
        start: Positions of the n joints of both arms at first [rad], by name.
        distance: Distance between the centres of the circles [m].

    Raises:
        ConfigError: If the URDF has no such arms.
        InterfaceError: If the circles are out of reach.
    """

    def __init__(
        self, urdf: str, arms: Sequence[str], start: Mapping[str, float], distance: float = 2.0 * CIRCLE_CENTRE[1]
    ) -> None:
        self._distance = distance
        self._solvers = {
            side: KdlSolver(
                KdlConfig.parse({"urdf_filename": urdf, "base_link": "world", "tip_link": f"{arm}_{LINK}"}, arm)
            )
            for side, arm in zip((1.0, -1.0), arms, strict=True)
        }
        self._posture = dict(start)
        self._posture = dict(zip(start, self._on_circles(0.0)))
        self._approach = minimum_jerk(tuple(start.values()), tuple(self._posture.values()), 0.0, APPROACH_S)

    def at(self, time_s: float) -> tuple[float, ...]:
        """Returns the n positions at a time since the start [s].

        Raises:
            InterfaceError: If a target of a hand is out of reach.
        """
        if time_s < APPROACH_S:
            return self._approach.sample(time_s).position
        time_s -= APPROACH_S
        return self._on_circles(time_s - RAMP_S / 2.0 if time_s > RAMP_S else time_s**2 / (2.0 * RAMP_S))

    def _on_circles(self, time_s: float) -> tuple[float, ...]:
        """Returns the n positions on the circles; near the same posture, so that all rounds are equal."""
        positions = dict(self._posture)
        for side, solver in self._solvers.items():
            position = hand_position(time_s, side, self._distance)
            found = solver.solve(IKProblem(Pose(position, POINTING_DOWN), start=self._posture))
            if not found.success:
                place = ", ".join(f"{each:.3f}" for each in position)
                raise InterfaceError(f"the hand cannot be at ({place}) m: {found.message}")
            positions.update(zip(solver.joint_names, found.positions))
        return tuple(positions.values())
