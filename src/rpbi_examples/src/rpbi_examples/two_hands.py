"""Plans joint positions with which the hands of two arms draw mirrored circles."""

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
"""Duration of the motion to the circles [s]."""
RAMP_S = 1.0
"""Time in which the hands reach full speed on the circles [s]."""


class MirroredHands:
    """Plans joint positions with which the hands of two arms move to mirrored circles and then draw the circles.

    Args:
        urdf: URDF file with both arms. The names of an arm's links and joints begin with the arm's name.
        arms: Names of the arms, the left arm first.
        start: Initial positions of the n joints of both arms [rad], indexed by joint name.
        distance: Distance between the centres of the circles [m].

    Raises:
        ConfigError: If the URDF does not contain both arms.
        InterfaceError: If the start of a circle is out of reach.
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
        """Returns the positions of the n joints [rad] at a time since the start [s], in the order of `start`.

        Raises:
            InterfaceError: If the target of a hand is out of reach.
        """
        if time_s < APPROACH_S:
            return self._approach.sample(time_s).position
        time_s -= APPROACH_S
        return self._on_circles(time_s - RAMP_S / 2.0 if time_s > RAMP_S else time_s**2 / (2.0 * RAMP_S))

    def _on_circles(self, time_s: float) -> tuple[float, ...]:
        """Returns the positions of the n joints [rad] at a time since the start of the circles [s].

        Inverse kinematics always start from the same posture, so that all rounds are equal.
        """
        positions = dict(self._posture)
        for side, solver in self._solvers.items():
            position = hand_position(time_s, side, self._distance)
            found = solver.solve(IKProblem(Pose(position, POINTING_DOWN), start=self._posture))
            if not found.success:
                place = ", ".join(f"{each:.3f}" for each in position)
                raise InterfaceError(f"the hand cannot be at ({place}) m: {found.message}")
            positions.update(zip(solver.joint_names, found.positions))
        return tuple(positions.values())
