"""The quadratic program that finds the accelerations and contact forces of a whole body."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from custom_ros_tools.errors import MissingDependency
from rpbi.control.controllers.controller import Array

from .dynamics import FREE, FloatingRobot, FrameMotion
from .tasks import AccelerationTask

try:
    import daqp
except ImportError as error:
    raise MissingDependency(error.name or "daqp", "./rpbi setup ik") from None

UNBOUNDED = 1e30
EQUAL, SOFT = 5, 8
"""Flags of the solver daqp for an equality and for a soft bound. A soft bound may be violated."""
LIMIT_RATE = 15.0
"""Natural frequency of the virtual springs at the joints' position limits [1/s]."""
WRENCH_COST = np.array((1e-5, 1e-5, 1e-6, 1e-3, 1e-3, 1e-3))
"""Costs of squared contact forces [1/N^2] and torques [1/(N m)^2]. These small costs make the feet share the load."""
FOOT_DAMPING = 20.0
"""Deceleration of a moving foot, divided by its velocity [1/s]."""


class WholeBodyProgram:
    """Finds the joint efforts t with which a robot best fulfils its tasks.

    The unknowns of the quadratic program are the accelerations a of base and joints, and the wrenches w on the feet.
    The cost is a weighted sum of the squared errors of tasks and posture, with small weights on the squares of a and w.
    With the mass matrix M, the bias b, the selection S of the joints, the Jacobian J of the feet, and the robot's
    velocities v, the constraints are:

    - Dynamics: M a + b = S^T t + J^T w, with t within the effort limits. The efforts follow from a and w.
    - Feet at rest: J a + dJ/dt v = -`FOOT_DAMPING` J v.
    - Soles that neither slide nor tip: C w <= 0.
    - Soft bounds on joint accelerations, which keep the joints within their position limits.

    The solver is not warm-started, so a solution depends only on robot and tasks.

    Args:
        robot: The robot, whose attributes `solve` reads.
        cone: The matrix C of one sole, shape (c, 6); see `wrench_cone`.
        feet: Number of feet.
    """

    def __init__(self, robot: FloatingRobot, cone: Array, feet: int) -> None:
        self._robot, self._n, self._of_feet = robot, robot.count, 6 * feet
        n, m, c = self._n, self._n + self._of_feet, len(cone) * feet
        fixed = FREE + self._of_feet
        self._matrix = np.zeros((fixed + c + n - FREE, m))
        self._matrix[fixed : fixed + c, n:] = np.kron(np.eye(feet), cone)
        self._lower = np.full(m + len(self._matrix), -UNBOUNDED)
        self._upper = np.full(m + len(self._matrix), UNBOUNDED)
        self._upper[m + fixed : m + fixed + c] = 0.0
        self._sense = np.zeros(m + len(self._matrix), np.intc)
        self._sense[FREE:n] = SOFT
        self._sense[m : m + fixed] = EQUAL
        self._joints, self._fixed = slice(FREE, n), slice(m, m + fixed)
        self._efforts = slice(m + fixed + c, None)
        self._diagonal = np.concatenate((np.full(n, 1e-6), np.tile(WRENCH_COST, feet)))

    def solve(
        self, tasks: Sequence[AccelerationTask], posture: Array, posture_weight: float, feet: Sequence[FrameMotion]
    ) -> Array | None:
        """Returns the efforts of the joints, shape (n - 6,) [N m], or None if there is no solution.

        Args:
            tasks: Desired accelerations of parts of the robot.
            posture: Desired accelerations of all joints, shape (n - 6,) [rad/s^2].
            posture_weight: Factor of the squared deviation from `posture` in the cost.
            feet: Motion of each sole, in the sole's own axes.
        """
        robot, n, matrix = self._robot, self._n, self._matrix
        jacobian = np.concatenate([foot.jacobian for foot in feet])
        drift = np.concatenate([foot.drift + FOOT_DAMPING * foot.velocity for foot in feet])
        hessian, gradient = self._cost(tasks, posture, posture_weight)
        matrix[:FREE, :n], matrix[:FREE, n:] = robot.mass_matrix[:FREE], -jacobian[:, :FREE].T
        matrix[FREE : FREE + self._of_feet, :n] = jacobian
        self._lower[self._fixed] = self._upper[self._fixed] = np.concatenate((-robot.bias[:FREE], -drift))
        self._lower[self._joints], self._upper[self._joints] = self._within_limits()
        of_joints = matrix[FREE - n :]
        of_joints[:, :n], of_joints[:, n:] = robot.mass_matrix[FREE:], -jacobian[:, FREE:].T
        bias = robot.bias[FREE:]
        self._lower[self._efforts], self._upper[self._efforts] = -robot.effort_limits - bias, robot.effort_limits - bias
        found, _, flag, _ = daqp.solve(hessian, gradient, matrix, self._upper, self._lower, self._sense)
        if flag <= 0 or not np.isfinite(found).all():
            return None
        efforts: Array = of_joints @ found + bias
        return efforts

    def _within_limits(self) -> tuple[Array, Array]:
        """Returns lower and upper bounds of the joint accelerations, each of shape (n - 6,) [rad/s^2].

        Each bound is the acceleration with which a critically damped spring would pull the joint to a position limit.
        """
        robot = self._robot
        damping = 2.0 * LIMIT_RATE * robot.velocities[FREE:]
        least, most = (LIMIT_RATE**2 * (limit - robot.positions) - damping for limit in (robot.lower, robot.upper))
        return least, most

    def _cost(self, tasks: Sequence[AccelerationTask], posture: Array, posture_weight: float) -> tuple[Array, Array]:
        n = self._n
        weights = np.concatenate([np.full(len(task.wanted), task.weight) for task in tasks])
        rows = np.concatenate([task.jacobian for task in tasks])
        wanted = np.concatenate([task.wanted for task in tasks])
        hessian = np.diag(self._diagonal)
        weighted = rows.T * weights
        hessian[:n, :n] += weighted @ rows
        gradient = np.zeros(len(hessian))
        gradient[:n] = -weighted @ wanted
        joints = np.arange(FREE, n)
        hessian[joints, joints] += posture_weight
        gradient[FREE:n] -= posture_weight * posture
        return hessian, gradient


def wrench_cone(half_length: float, half_width: float, friction: float) -> Array:
    """Returns the matrix C for a rectangular sole. The sole neither slides nor tips under a wrench w if C w <= 0.

    The wrench is the force [N] and torque [N m] of the floor on the middle of the sole, in the sole's axes: x along the
    sole, z up. An inscribed pyramid approximates the friction cone. Source: Caron, Pham and Nakamura, "Stability of
    surface contacts for humanoid robots", ICRA 2015.

    Args:
        half_length: Half the sole's length along x [m].
        half_width: Half the sole's width along y [m].
        friction: Coefficient of friction between sole and floor.

    Returns:
        Matrix of shape (16, 6).
    """
    x, y, mu = half_length, half_width, friction / np.sqrt(2.0)
    rows = [(a, b, -mu, 0.0, 0.0, 0.0) for a, b in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))]
    rows += [(0.0, 0.0, -y, sign, 0.0, 0.0) for sign in (1.0, -1.0)]
    rows += [(0.0, 0.0, -x, 0.0, sign, 0.0) for sign in (1.0, -1.0)]
    for a, b, turn in product((1.0, -1.0), repeat=3):
        # turn * torque_z <= mu (x + y) f_z - |y f_x + turn * mu torque_x| - |x f_y + turn * mu torque_y|
        rows.append((a * y, b * x, -mu * (x + y), turn * a * mu, turn * b * mu, turn))
    return np.array(rows)
