"""Learns and plans motions with the services of `dmp_server`."""

from __future__ import annotations

import numpy as np

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import Array
from motion_primitives import MotionPlan
from motion_primitives.ros.dmp_services import DMPProcessor
from motion_primitives.space import Space

from .skill import ALPHA_PER_S, BASES_PER_S, MIN_BASES, NAMES

SAMPLE_S, STEPS = 0.02, 4
"""Time between two points of a plan [s], and steps of integration between them."""
NEAR_M = 0.003
"""Distance from the goal at which a plan ends [m]."""


class ServerMotion:
    """A motion that the service `learn_dmp_from_demo` learned from a demonstration, with one DMP for each axis.

    Args:
        times: Times of the m samples of the demonstration [s].
        places: Position of the tip in each sample, shape (m, 2) [m].

    Raises:
        InterfaceError: If the service rejects the demonstration.
    """

    def __init__(self, times: Array, places: Array) -> None:
        times = times - times[0]
        self._start, self._goal = places[0], places[-1]
        self._first_velocity = np.gradient(places, times, axis=0)[0]
        self._services = DMPProcessor()
        damping = ALPHA_PER_S * max(float(times[-1]), 1.0)
        bases = max(MIN_BASES, round(BASES_PER_S * float(times[-1])))
        learned = self._services.learn_dmp(times, places.T, damping**2 / 4.0, damping, bases)
        if learned is None:
            raise InterfaceError("learn_dmp_from_demo refused the demonstration; the log has the reason")
        self._learned = learned

    def plan(self, start: Array | None = None) -> MotionPlan:
        """Plans the learned motion with the service `get_dmp_plan`.

        Args:
            start: First position, shape (2,) [m]. Default: the demonstrated start.

        Raises:
            InterfaceError: If a service rejects the request.
        """
        first = self._start if start is None else start
        near = np.full(len(first), NEAR_M)
        learned, velocity = self._learned, self._first_velocity
        _, times, positions, velocities = self._services.generate_plan(
            learned, first, velocity, 0.0, self._goal, near, -1.0, learned.tau, SAMPLE_S, STEPS
        )
        if times is None or positions is None or velocities is None:
            raise InterfaceError("get_dmp_plan refused the request; the log has the reason")
        return MotionPlan(
            Space(NAMES),
            np.concatenate([[0.0], times]),
            np.vstack([first, positions.T]),
            np.vstack([velocity, velocities.T]),
        )
