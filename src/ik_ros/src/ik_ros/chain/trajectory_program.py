"""Joint splines, and the nonlinear program that computes their control points."""

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np
from scipy.interpolate import BSpline

from ik_ros.shape import ShapeConfig
from robot_model.chain import Chain
from robot_model.limits import Limits

from .symbolic import link_frames, rotation_vector, sphere_distances

DEGREE = 3
SAMPLES = 2
"""Number of samples in each interval of the spline at which distances to obstacles are constrained."""
SAFETY_M = 5e-3
"""Clearance added at the samples [m], since spheres may come nearer to obstacles between two samples."""
ITERATIONS = 100
OPTIONS: Any = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "max_iter": ITERATIONS,
        "tol": 1e-5,
        "constr_viol_tol": 1e-6,
        "expect_infeasible_problem": "yes",
        "bound_relax_factor": 0.0,
    },
}


class Spline:
    """Cubic B-splines over the time from 0 to 1, for any number of joints.

    At each time, a B-spline is a convex combination of its control points, and each derivative is a convex combination
    of the derivative's control points. So limits that hold at all control points hold at all times (de Boor, A
    Practical Guide to Splines, 1978). Accelerations are piecewise linear.

    Args:
        intervals: Number of polynomial pieces of the spline.

    Attributes:
        count: Number m of control points.
        times: Time of each control point, from 0 to 1: the mean of the control point's inner knots (Greville abscissa).
        to_velocity: Matrix from position control points to velocity control points, (m - 1) x m.
        to_acceleration: Matrix from position control points to acceleration control points, (m - 2) x m.
    """

    def __init__(self, intervals: int) -> None:
        knots = np.concatenate((np.zeros(DEGREE), np.linspace(0.0, 1.0, intervals + 1), np.ones(DEGREE)))
        self.intervals = intervals
        self.count = intervals + DEGREE
        self.times = np.array([knots[i + 1 : i + 1 + DEGREE].mean() for i in range(self.count)])
        self._spline = BSpline(knots, np.eye(self.count), DEGREE)
        self.to_velocity = self._spline.derivative(1).c[: self.count - 1]
        self.to_acceleration = self._spline.derivative(2).c[: self.count - 2]

    def basis(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Returns the matrix that maps the m control points to the spline's values at k times.

        Args:
            times: k times from 0 to 1.
            order: Order of the derivative: 0 for positions, 1 for velocities, 2 for accelerations.

        Returns:
            The matrix, k x m.
        """
        return np.asarray((self._spline.derivative(order) if order else self._spline)(times))

    @property
    def roughness(self) -> np.ndarray:
        """Matrix R, m x m, such that p^T R p is a spline's integrated squared acceleration for control points p."""
        pair = np.array(((2.0, 1.0), (1.0, 2.0))) / (
            6.0 * self.intervals
        )  # integral of the square of a linear function, given by its end values
        weights = np.zeros((self.count - 2,) * 2)
        for i in range(self.intervals):
            weights[i : i + 2, i : i + 2] += pair
        return np.asarray(self.to_acceleration.T @ weights @ self.to_acceleration)


class Program:
    """Nonlinear program for the smoothest splines that pass through all waypoints within limits, solved by Ipopt.

    Args:
        chain: The chain.
        shapes: Spheres on links of the chain, and obstacles fixed in the base frame.
        intervals: Number of polynomial pieces of each joint's spline.
        waypoints: Number of waypoints.

    Attributes:
        spline: B-spline basis that all joints share.
    """

    def __init__(self, chain: Chain, shapes: Sequence[ShapeConfig], intervals: int, waypoints: int) -> None:
        self.spline = spline = Spline(intervals)
        self._joints = joints = len(chain.joint_names)
        points = casadi.MX.sym("points", spline.count, joints)
        poses = casadi.MX.sym("poses", 12, waypoints)
        basis = casadi.MX.sym("basis", waypoints, spline.count)
        q = casadi.SX.sym("q", joints)
        frames = link_frames(chain, q)
        pose = casadi.SX.sym("pose", 12)
        rotation, position = list(frames.values())[-1]
        target = casadi.reshape(pose[:9], 3, 3)
        off = casadi.vertcat(target.T @ (position - pose[9:]), rotation_vector(target.T @ rotation))
        to_off = casadi.Function("off", [q, pose], [off])
        postures = casadi.MX.sym("postures", joints, waypoints)  # additional unknowns, so that the Hessian is sparse
        passed = to_off.map(waypoints)(postures, poses)
        distances = sphere_distances(shapes, frames)
        times = np.linspace(0.0, 1.0, SAMPLES * spline.intervals + 1)[1:]
        self._distances = len(times) * len(distances)
        apart = []
        if distances:
            to_distances = casadi.Function("distances", [q], [casadi.vertcat(*distances)])
            sampled = _sparse(spline.basis(times)) @ points
            apart = [casadi.vec(to_distances.map(len(times))(sampled.T))]
        constraints = casadi.vertcat(
            casadi.vec(_sparse(spline.to_velocity) @ points),
            casadi.vec(_sparse(spline.to_acceleration) @ points),
            casadi.vec(postures - (basis @ points).T),
            casadi.vec(passed),
            *apart,
        )
        cost = casadi.sum1(casadi.sum2(points * (_sparse(spline.roughness) @ points)))
        parameters = casadi.veccat(poses, basis)
        nlp: Any = {"x": casadi.veccat(points, postures), "p": parameters, "f": cost, "g": constraints}
        self._solve: Any = casadi.nlpsol("trajectory", "ipopt", nlp, OPTIONS)

    def solve(
        self,
        *,
        start: np.ndarray,
        poses: np.ndarray,
        basis: np.ndarray,
        tolerance: np.ndarray,
        limits: Limits,
        max_velocity: np.ndarray,
        max_acceleration: np.ndarray,
        clearance: float,
        guess: np.ndarray,
    ) -> tuple[np.ndarray, str]:
        """Solves the program for n joints, m control points and w waypoints.

        The unit of time is the duration of the trajectory.

        Args:
            start: n start positions, at rest [rad or m].
            poses: Poses of the waypoints in the base frame, 12 x w: 9 numbers of the rotation matrix, column by
                column, and 3 numbers of the position [m].
            basis: Matrix from control points to the positions at the waypoints, w x m, see `Spline.basis`.
            tolerance: Largest errors of the tip at a waypoint: 3 along [m] and 3 about [rad] the waypoint's axes.
            limits: Limits of the n joints.
            max_velocity: Largest speeds of the n joints, per unit of time.
            max_acceleration: Largest accelerations of the n joints, per unit of time squared.
            clearance: Smallest distance of spheres from obstacles [m].
            guess: Control points where the search starts, m x n [rad or m].

        Returns:
            Control points within the limits, m x n [rad or m], and Ipopt's status.
        """
        count = self.spline.count
        lower, upper = (np.tile(ends, (count, 1)) for ends in (limits.lower, limits.upper))
        lower[:2] = upper[:2] = start  # two equal control points at the start: the spline starts at rest
        speed = np.tile(max_velocity, (count - 1, 1))
        speed[-1] = 0.0
        change = np.tile(max_acceleration, (count - 2, 1))
        allowed = np.tile(tolerance, poses.shape[1])
        apart = np.full(self._distances, clearance + SAFETY_M)
        postures = (basis @ guess).ravel()
        free = np.full(len(postures), np.inf)
        most = np.concatenate((speed.T.ravel(), change.T.ravel(), 0.0 * postures, allowed))
        answer = self._solve(
            x0=np.concatenate((guess.T.ravel(), postures)),
            p=np.concatenate((poses.T.ravel(), basis.T.ravel())),
            lbx=np.concatenate((lower.T.ravel(), -free)),
            ubx=np.concatenate((upper.T.ravel(), free)),
            lbg=np.concatenate((-most, apart)),
            ubg=np.concatenate((most, np.full(len(apart), np.inf))),
        )
        points = np.array(answer["x"])[: count * self._joints].reshape(self._joints, count).T
        status = str(self._solve.stats()["return_status"])
        if not np.isfinite(points).all():
            return np.tile(start, (count, 1)), status
        points[-2] = points[-1]
        return np.clip(points, limits.lower, limits.upper), status


def _sparse(matrix: np.ndarray) -> casadi.DM:
    """Converts a matrix to a sparse CasADi matrix, so that CasADi skips the matrix's zeros in derivatives."""
    return casadi.sparsify(casadi.DM(matrix))
