"""From one target to the next without jumps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive

Array = npt.NDArray[np.float64]


class JointRateLimiterConfig(ConfigModel):
    """How targets follow each other."""

    max_velocity: Positive | dict[str, Positive] | None = Field(
        None,
        description="Largest velocity of each joint, one for all or by joint [rad/s or m/s]; the URDF's if left out.",
    )
    velocity_scale: float = Field(1.0, gt=0.0, le=1.0, description="Share of these velocities that is used.")


class JointRateLimiter:
    """Keeps the joints between two targets within their velocities.

    Where the solution is further away, the target goes as far towards it as the slowest joint allows, all joints in
    proportion. So near a singularity, where little movement of the link takes much of the joints, the robot falls
    behind instead of jumping, and it crosses over to another posture at the speed of its joints.

    Args:
        config: How.
        joint_names: The n joints.
        velocity_limits: Their velocities by the URDF [rad/s or m/s]; 0 and inf mean that it has none.

    Raises:
        ValueError: If the configuration names a joint that is not there, or a joint has no limit at all.
    """

    def __init__(
        self, config: JointRateLimiterConfig, joint_names: Sequence[str], velocity_limits: Sequence[float]
    ) -> None:
        limits = dict(zip(joint_names, velocity_limits))
        given = config.max_velocity
        if isinstance(given, dict):
            unknown = sorted(set(given) - set(limits))
            if unknown:
                known = ", ".join(joint_names)
                raise ValueError(f"continuity.max_velocity: no joint is called {', '.join(unknown)}; known are {known}")
            limits |= given
        elif given is not None:
            limits = dict.fromkeys(limits, given)
        unlimited = [name for name, limit in limits.items() if not 0.0 < limit < np.inf]
        if unlimited:
            raise ValueError(
                f"continuity.max_velocity: the URDF has no velocity for {', '.join(unlimited)}; give it one here"
            )
        self._limits = config.velocity_scale * np.array(list(limits.values()))
        self._last: Array | None = None

    def begin(self, positions: Sequence[float]) -> None:
        """Goes on from n positions [rad or m]; else the first target is wherever the first solution is."""
        self._last = np.array(positions, dtype=float)

    def next(self, solution: Sequence[float], period_s: float) -> tuple[Array, float]:
        """Returns the next target.

        Args:
            solution: The n positions to go to [rad or m].
            period_s: Time since the last target [s].

        Returns:
            n positions [rad or m], and which share of the way to the solution they are at, 1 at the solution.
        """
        goal = np.array(solution, dtype=float)
        if self._last is None:
            self._last = goal
            return goal, 1.0
        way = goal - self._last
        needed_s = float(np.max(np.abs(way) / self._limits, initial=0.0))
        share = 1.0 if needed_s <= period_s else max(period_s, 0.0) / needed_s
        self._last = goal if share == 1.0 else self._last + share * way
        return self._last, share
