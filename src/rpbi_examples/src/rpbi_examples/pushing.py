"""Plans motions of an arm that pushes a box over the floor to a goal. A ball at the arm's hand touches the box."""

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
"""Goals of the box's centre, which alternate: x and y in the frame of the arm's base [m]."""
HALF_SIDES_M = (0.10, 0.08)
"""Half of the box's side lengths along the box's own x and y [m]."""
NEAR_M = 0.05
"""Least distance by which a push must bring the box nearer to its goal [m]."""
CLEARANCE_M = 0.04
"""Distance of the ball from the box before and after a push [m]."""
GAP_M = 0.001
"""Distance between ball and box where the ball stops before a push [m]."""
PUSH_HEIGHT_M, TRAVEL_HEIGHT_M = 0.05, 0.25
"""Height of the ball during a push, and while the ball moves above the box [m]."""
PUSH_SPEED, TRAVEL_SPEED = 0.15, 0.35
"""Mean speed of the ball during a push, and in other straight lines [m/s]."""
JOINT_SPEED = 0.8
"""Mean speed of the joint with the largest motion, in the move from an arbitrary posture [rad/s]."""
MIN_DURATION_S = 0.5
"""Least duration of a move [s]."""
SPACING_M = 0.02
"""Largest distance between two points of a straight line for which inverse kinematics are solved [m]."""
POINTING_DOWN = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the hand as quaternion x, y, z, w."""
POSTURE = np.radians((0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0))
"""Joint positions from which inverse kinematics start [rad]."""
ELBOW_LEAN = 1.5
"""Position of the third joint at the start of inverse kinematics, divided by the ball's y coordinate [rad/m]."""


class Push(NamedTuple):
    """A push along a straight line, in the frame of the arm's base.

    Attributes:
        start: Position x, y of the ball at the first contact with the box [m].
        end: Position x, y of the ball at the end of the push [m].
    """

    start: tuple[float, float]
    end: tuple[float, float]

    def beside(self, way_m: float) -> tuple[float, float]:
        """Returns the point on the push's line at the distance `way_m` before `start` [m]. Negative: after `start`."""
        length = math.dist(self.start, self.end)
        x, y = ((begin - end) / length * way_m for begin, end in zip(self.start, self.end))
        return self.start[0] + x, self.start[1] + y


class Move(NamedTuple):
    """Motion of the joints that starts and ends at rest.

    Attributes:
        path: Positions of the joints [rad] as a function of the path parameter, from 0 to 1.
        duration_s: Duration of the motion [s].
    """

    path: CubicSpline
    duration_s: float

    def at(self, time_s: float) -> tuple[float, ...]:
        """Returns the positions of the joints [rad] at a time since the start of the move [s]."""
        (way,) = minimum_jerk((0.0,), (1.0,), 0.0, self.duration_s).sample(time_s).position
        return tuple(self.path(way).tolist())

    @property
    def end(self) -> tuple[float, ...]:
        """Positions of the joints at the end of the move [rad]."""
        return self.at(self.duration_s)


def next_push(box: PlanarPose, goal: tuple[float, float]) -> Push | None:
    """Returns the push that brings a box nearest to a goal. None if the box would come less than `NEAR_M` nearer.

    The ball pushes perpendicularly against the middle of a side, so that the box hardly turns.

    Args:
        box: Pose of the box in the frame of the arm's base.
        goal: Goal x, y of the box's centre in the same frame [m].
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
    """Returns a solver of inverse kinematics for the ball at the hand of a KUKA LWR4+."""
    options = {"urdf_filename": URDF, "base_link": BASE, "tip_link": BALL, "residualThreshold": 1e-4}
    return PybulletSolver(PybulletConfig.parse(options, "the arm that pushes"))


class Pusher:
    """Plans the arm's moves for a push.

    Args:
        solver: Solver of inverse kinematics for the ball, in the frame of the arm's base.
    """

    def __init__(self, solver: ChainSolver) -> None:
        self._solver = solver

    def moves(self, positions: Sequence[float], push: Push) -> list[Move]:
        """Returns the ball's moves for a push: up, above the start, down, to the box, along the push, back, and up.

        Args:
            positions: Joint positions before the first move [rad].
            push: The push.

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
        """Returns the move from joint positions [rad] that brings the ball to a point [m], along a curved path."""
        ends = np.array((positions, self._solve(point)))
        return Move(CubicSpline((0.0, 1.0), ends), max(np.abs(ends[1] - ends[0]).max() / JOINT_SPEED, MIN_DURATION_S))

    def _line(self, start: Vector, end: Vector, speed: float) -> Move:
        """Returns the move of the ball along a straight line between two points [m], at a mean speed [m/s]."""
        length = math.dist(start, end)
        ways = np.linspace(0.0, 1.0, max(2, math.ceil(length / SPACING_M) + 1))
        points = np.outer(1.0 - ways, start) + np.outer(ways, end)
        return Move(
            CubicSpline(ways, [self._solve(point) for point in points.tolist()]), max(length / speed, MIN_DURATION_S)
        )

    def _solve(self, point: Sequence[float]) -> tuple[float, ...]:
        """Returns joint positions [rad] at which the ball is at a point [m]. The result depends only on the point.

        Raises:
            ValueError: If the point is out of reach.
        """
        x, y, z = point
        posture = POSTURE.tolist()
        posture[2] = ELBOW_LEAN * y
        start = dict(zip(self._solver.joint_names, posture))
        solution = self._solver.solve(IKProblem(Pose((x, y, z), POINTING_DOWN), start=start))
        if not solution.success:
            raise ValueError(f"({x:.2f}, {y:.2f}, {z:.2f}) m is out of reach: {solution.message}")
        return solution.positions
