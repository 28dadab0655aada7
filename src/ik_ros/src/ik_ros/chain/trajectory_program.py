"""Splines of joints, and the nonlinear program that shapes them."""

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
"""Number of points in each interval of the spline at which distances to obstacles are constrained."""
SAFETY_M = 5e-3
"""Additional clearance at these points [m], since spheres may come nearer between them."""
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

    A B-spline is a convex combination of its control points, and so are its derivatives: limits that hold at the
    control points hold everywhere (de Boor, A Practical Guide to Splines, 1978). Accelerations are piecewise linear.

    Args:
        intervals: Number of successive polynomials.

    Attributes:
        count: Number m of control points.
        times: Time of the largest weight of each control point, from 0 to 1: the mean of its knots.
        to_velocity: Control points of the velocity from those of the position, (m - 1) x m.
        to_acceleration: The same of the acceleration, (m - 2) x m.
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
        """Returns the weight of each control point.

        Args:
            times: k times from 0 to 1.
            order: 0 for positions, 1 for velocities, 2 for accelerations, per unit of time.

        Returns:
            k x m numbers; times the control points, they are the k values.
        """
        return np.asarray((self._spline.derivative(order) if order else self._spline)(times))

    @property
    def roughness(self) -> np.ndarray:
        """The matrix of the integral of the squared acceleration, m x m."""
        pair = np.array(((2.0, 1.0), (1.0, 2.0))) / (
            6.0 * self.intervals
        )  # integral of the square of a line, from its ends
        weights = np.zeros((self.count - 2,) * 2)
        for i in range(self.intervals):
            weights[i : i + 2, i : i + 2] += pair
        return np.asarray(self.to_acceleration.T @ weights @ self.to_acceleration)


class Program:
    """Finds the smoothest splines that pass all waypoints within limits; Ipopt solves it.

    Args:
        chain: The chain.
        shapes: Spheres on its links, and obstacles in the base to avoid.
        intervals: Number of polynomials of each joint's spline.
        waypoints: Number of waypoints.

    Attributes:
        spline: The splines.
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
        postures = casadi.MX.sym("postures", joints, waypoints)  # unknowns too, so that the Hessian stays sparse
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
        """Solves it over the time from 0 to 1, for n joints, m control points and w waypoints.

        Args:
            start: n start positions, at rest [rad or m].
            poses: Rotation (9 numbers, by columns) and position (3) of each waypoint, 12 x w.
            basis: Weight of each control point at each waypoint, w x m.
            tolerance: Largest errors of the tip at a waypoint, along and about its axes: 6 numbers [m, rad].
            limits: Limits of the n joints.
            max_velocity: n largest speeds, per unit of time.
            max_acceleration: n largest accelerations, per unit of time squared.
            clearance: Smallest distance of spheres from obstacles [m].
            guess: m x n control points to start from.

        Returns:
            m x n control points within limits [rad or m], and Ipopt's status.
        """
        count = self.spline.count
        lower, upper = (np.tile(ends, (count, 1)) for ends in (limits.lower, limits.upper))
        lower[:2] = upper[:2] = start  # two equal control points: at rest at that end
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
    """Returns a matrix with its zeros as structural ones, so that derivatives do not depend on them."""
    return casadi.sparsify(casadi.DM(matrix))
