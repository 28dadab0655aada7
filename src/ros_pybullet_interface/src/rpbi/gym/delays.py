"""Delays of actions and observations in ticks of the world."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from copy import deepcopy
from typing import Any


class DelayLine:
    """Runs the ticks of an action, in which older actions begin to act and observations are made that are due later.

    An observation that is d ticks old at the end of an action was made d ticks before that; those from before the
    episode are the one of its start.

    Args:
        ticks: Ticks of an action.
        observation_ticks: Age of observations.
        action_ticks: Time until an action begins to act.
        first: The observation of the start.
    """

    def __init__(self, ticks: int, observation_ticks: int, action_ticks: int, first: Any) -> None:
        self._ticks, self._action_ticks = ticks, action_ticks
        self._observed_at = (-observation_ticks) % ticks or ticks
        """Tick of each action, counted from 1, after which an observation is made."""
        self._observations = deque(deepcopy(first) for _ in range(observation_ticks // ticks))
        self._actions: deque[tuple[int, Any]] = deque()
        self._tick = 0

    def run(self, action: Any, act: Callable[[Any], None], step: Callable[[], Any], observe: Callable[[], Any]) -> Any:
        """Runs one action, and returns the observation that is due at its end.

        Args:
            action: The action.
            act: Has an action begin to act.
            step: Advances by a tick.
            observe: Returns the present observation.
        """
        actions = self._actions
        actions.append((self._tick + self._action_ticks, action))
        for tick in range(1, self._ticks + 1):
            if actions and actions[0][0] <= self._tick:
                act(actions.popleft()[1])
            step()
            self._tick += 1
            if tick == self._observed_at:
                self._observations.append(observe())
        return self._observations.popleft()
