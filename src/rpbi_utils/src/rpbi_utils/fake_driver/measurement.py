"""Emulates a robot's measured joint states, with delay and noise."""

from __future__ import annotations

import random
from collections import deque

from custom_ros_tools.joint_values import JointValues

from .config import NoiseConfig


class Measurement:
    """Delays joint states and adds noise. The same states at the same times result in the same measurements."""

    def __init__(self, config: NoiseConfig) -> None:
        self._config = config
        self._random = random.Random(config.seed)
        self._waiting: deque[tuple[float, JointValues]] = deque()

    def observe(self, now_s: float, state: JointValues) -> JointValues | None:
        """Queues the state at time `now_s` [s]. Returns the newest state whose age has reached the delay, with noise.

        Returns None if no further state has reached this age since the last call.
        """
        self._waiting.append((now_s + self._config.delay_s, state))
        known = None
        while self._waiting and self._waiting[0][0] <= now_s:
            _, known = self._waiting.popleft()
        return None if known is None else self._noisy(known)

    def _noisy(self, state: JointValues) -> JointValues:
        config = self._config

        def add(values: tuple[float, ...], deviation: float) -> tuple[float, ...]:
            return tuple(value + self._random.gauss(0.0, deviation) for value in values)

        return JointValues(
            state.names,
            add(state.position, config.position),
            add(state.velocity, config.velocity),
            add(state.effort, config.effort),
        )
