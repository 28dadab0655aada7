"""Measured states of an emulated robot: delayed and with noise."""

from __future__ import annotations

import random
from collections import deque

from custom_ros_tools.joint_values import JointValues

from .config import NoiseConfig


class Measurement:
    """Delays states and adds noise to them; equal states at equal times result in equal measurements."""

    def __init__(self, config: NoiseConfig) -> None:
        self._config = config
        self._random = random.Random(config.seed)
        self._waiting: deque[tuple[float, JointValues]] = deque()

    def observe(self, now_s: float, state: JointValues) -> JointValues | None:
        """Adds the state at a time [s]; returns the newest one older than the delay, None if there is none yet."""
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
