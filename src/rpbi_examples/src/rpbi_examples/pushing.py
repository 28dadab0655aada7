"""Motion of an arm that pushes a box over the floor with the ball at its hand, from one place to another and back."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ik_ros.chain.solver import ChainSolver
from ik_ros.problem import IKProblem
from ik_ros.solvers.pybullet_solver import PybulletConfig, PybulletSolver
from robot_model.geometry import Pose, Vector
from rpbi.control.trajectories.trajectory import minimum_jerk

from .motions import PlanarPose

URDF = "{rpbi_examples}/robots/kuka_lwr.urdf"
BASE, BALL = "base", "end_effector_ball"
BALL_RADIUS_M = 0.015
PLACES = ((-0.6, 0.2), (-0.6, -0.2))
"""Targets of the centre of the box, in turn: x and y in the frame of the arm's base [m]."""
HALF_SIDES_M = (0.10, 0.08)
"""Half of the box's sides along its own x and y [m]."""
NEAR_M = 0.05
"""Least improvement that justifies one more push [m]."""
CLEARANCE_M = 0.04
"""Distance of the ball from the box before and after a push [m]."""
GAP_M = 0.001
"""Distance of the ball from the box at the start of a push, from rest [m]."""
PUSH_HEIGHT_M, TRAVEL_HEIGHT_M = 0.05, 0.25
"""Height of the ball [m] while it pushes, and above the box."""
PUSH_SPEED, TRAVEL_SPEED = 0.15, 0.35
"""Mean speed of the ball [m/s]."""
JOINT_SPEED = 0.8
"""Mean speed of the joint with the largest motion [rad/s], of the motion from an arbitrary posture."""
MIN_DURATION_S = 0.5
"""Least time for a straight line [s]."""
SPACING_M = 0.02
"""Distance of the points of a line for which inverse kinematics are solved [m]."""
POINTING_DOWN = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the hand as x, y, z, w."""
POSTURE = np.radians((0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0))
"""Start of the search for joint positions [rad]."""
ELBOW_LEAN = 1.5
"""Rotation of the third joint in that start for each metre of the ball to the side [rad/m]."""


class Push(NamedTuple):
    """A push along a straight line, in the frame of the arm's base.

    Attributes:
        start: Where the ball touches the box, x and y [m].
        end: Where it stops.
    """

    start: tuple[float, float]
    end: tuple[float, float]

    def beside(self, way_m: float) -> tuple[float, float]:
        """Returns the point at a distance before the start; a negative distance is along the push [m]."""
        length = math.dist(self.start, self.end)
        x, y = ((begin - end) / length * way_m for begin, end in zip(self.start, self.end))
        return self.start[0] + x, self.start[1] + y


class Move(NamedTuple):
    """Joint positions over time, from rest to rest.

    Attributes:
        path: Positions of the joints [rad] along the path, whose parameter goes from 0 to 1.
        duration_s: Duration [s].
    """

    path: CubicSpline
    duration_s: float

    def at(self, time_s: float) -> tuple[float, ...]:
        """Returns the positions [rad] at a time since its start [s]."""
        (way,) = minimum_jerk((0.0,), (1.0,), 0.0, self.duration_s).sample(time_s).position
        return tuple(self.path(way).tolist())

    @property
    def end(self) -> tuple[float, ...]:
        """The positions at its end [rad]."""
        return self.at(self.duration_s)


def next_push(box: PlanarPose, goal: tuple[float, float]) -> Push | None:
    """Returns the push that brings a box nearest to a goal, None if the box is there.

    The ball pushes the middle of one of the four sides, perpendicular to it, so that the box hardly turns.
    """
    best, least = None, math.dist((box.x, box.y), goal) - NEAR_M
    for turns in range(4):
        angle = box.yaw + turns * math.pi / 2.0
        ahead = math.cos(angle), math.sin(angle)
        way = ahead[0] * (goal[0] - box.x) + ahead[1] * (goal[1] - box.y)
        left = math.dist((box.x + way * ahead[0], box.y + way * ahead[1]), goal)
        if way > 0.0 and left < least:
            back = HALF_SIDES_M[turns % 2] + BALL_RADIUS_M
            start, end = ((box.x + s * ahead[0], box.y + s * ahead[1]) for s in (-back, way - back))
            best, least = Push(start, end), left
    return best


def ball_solver() -> ChainSolver:
    """Returns the inverse kinematics of the ball at the hand of a KUKA LWR4+."""
    options = {"urdf_filename": URDF, "base_link": BASE, "tip_link": BALL, "residualThreshold": 1e-4}
    return PybulletSolver(PybulletConfig.parse(options, "the arm that pushes"))


class Pusher:
    """Plans the moves of a push.

    Args:
        solver: Inverse kinematics of the ball, in the frame of the arm's base.
    """

    def __init__(self, solver: ChainSolver) -> None:
        self._solver = solver

    def moves(self, positions: Sequence[float], push: Push) -> list[Move]:
        """Returns the moves from some joint positions [rad]: up, over, down, to the box, the push, back and up.

        Raises:
            ValueError: If a point of the path is out of reach.
        """
        here = self._solver.chain.pose(positions).position
        before, after = push.beside(CLEARANCE_M), push.beside(CLEARANCE_M - math.dist(push.start, push.end))
        corners = [
            (*before, TRAVEL_HEIGHT_M),
            (*before, PUSH_HEIGHT_M),
            (*push.beside(GAP_M), PUSH_HEIGHT_M),
            (*push.end, PUSH_HEIGHT_M),
            (*after, PUSH_HEIGHT_M),
            (*after, TRAVEL_HEIGHT_M),
        ]
        if here[2] < TRAVEL_HEIGHT_M - CLEARANCE_M:
            corners.insert(0, (here[0], here[1], TRAVEL_HEIGHT_M))
        lines = (
            self._line(start, end, PUSH_SPEED if end[:2] == push.end else TRAVEL_SPEED)
            for start, end in pairwise(corners)
        )
        return [self._approach(positions, corners[0]), *lines]

    def _approach(self, positions: Sequence[float], point: Vector) -> Move:
        """Returns the move from any posture [rad] to the one with the ball at a point [m]."""
        ends = np.array((positions, self._solve(point)))
        return Move(CubicSpline((0.0, 1.0), ends), max(np.abs(ends[1] - ends[0]).max() / JOINT_SPEED, MIN_DURATION_S))

    def _line(self, start: Vector, end: Vector, speed: float) -> Move:
        """Returns the move of the ball along a straight line [m] at a mean speed [m/s]."""
        length = math.dist(start, end)
        ways = np.linspace(0.0, 1.0, max(2, math.ceil(length / SPACING_M) + 1))
        points = np.outer(1.0 - ways, start) + np.outer(ways, end)
        return Move(
            CubicSpline(ways, [self._solve(point) for point in points.tolist()]), max(length / speed, MIN_DURATION_S)
        )

    def _solve(self, point: Sequence[float]) -> tuple[float, ...]:
        """Returns the joint positions [rad] with the ball at a point [m], always the same for the same point."""
        x, y, z = point
        posture = POSTURE.tolist()
        posture[2] = ELBOW_LEAN * y
        start = dict(zip(self._solver.joint_names, posture))
        solution = self._solver.solve(IKProblem(Pose((x, y, z), POINTING_DOWN), start=start))
        if not solution.success:
            raise ValueError(f"({x:.2f}, {y:.2f}, {z:.2f}) m is out of reach: {solution.message}")
        return solution.positions
