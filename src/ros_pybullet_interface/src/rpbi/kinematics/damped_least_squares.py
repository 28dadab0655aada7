"""Damped least squares, the solver for almost everything."""

from __future__ import annotations

import numpy as np
import pybullet

from .chain import Chain
from .target import Target

FROZEN = 1e6
"""Damping that keeps a joint where it is."""
DAMPING = 1e-3
"""Damping of the most willing joint. With PyBullet's own 0.5, it takes some hundred iterations rather than ten."""
JOINT_ITERATIONS_A_CALL = 140
"""Iterations in one call of PyBullet, times the number of joints: it holds Python's lock meanwhile, some 0.1 ms."""


class DampedLeastSquares:
    """PyBullet's damped least squares.

    Args:
        chain: The link to move.
        target: Where it shall be.
        threshold_m: Distance at which to stop [m].
        damping: How unwilling each of the m joints is to move; the least is 1.
    """

    def __init__(self, chain: Chain, target: Target, threshold_m: float, damping: np.ndarray) -> None:
        self._chain = chain
        self._damping = DAMPING * damping
        self._arguments = {"targetPosition": target.position, "residualThreshold": threshold_m}
        if target.quat_xyzw is not None:
            self._arguments["targetOrientation"] = target.quat_xyzw

    def __call__(self, q: np.ndarray, frozen: np.ndarray, iterations: int) -> np.ndarray:
        """See `Step`."""
        damping = np.where(frozen, FROZEN, self._damping).tolist()
        a_call = max(1, JOINT_ITERATIONS_A_CALL // len(q))
        for done in range(0, iterations, a_call):
            q = self._call(q, damping, min(a_call, iterations - done))
        return q

    def _call(self, q: np.ndarray, damping: list[float], iterations: int) -> np.ndarray:
        chain = self._chain
        chain.set(q)
        return np.array(
            chain.pb.calculateInverseKinematics(
                chain.body_id,
                chain.link_index,
                jointDamping=damping,
                maxNumIterations=iterations,
                solver=pybullet.IK_DLS,
                **self._arguments,
            )
        )
