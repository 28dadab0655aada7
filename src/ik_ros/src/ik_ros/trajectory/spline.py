"""Splines of joints, bounded by their control points."""

import numpy as np
from scipy.interpolate import BSpline

DEGREE = 3


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
