"""One environment of many, with its automatic resets."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium
from gymnasium.vector import AutoresetMode


class Outcome(NamedTuple):
    """What a step led to.

    Attributes:
        observation: The observation that the next action is for.
        reward: The reward.
        terminated: Whether the episode is over.
        truncated: Whether it was truncated.
        info: Further information.
        final: With resets in the same step, the last observation and information of the episode that has ended.
    """

    observation: Any
    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]
    final: dict[str, Any] | None = None


class Slot:
    """An environment that is reset when its episode has ended, by one of Gymnasium's three modes.

    Args:
        env: The environment.
        mode: `NEXT_STEP` resets it instead of the next step, whose action is ignored; `SAME_STEP` in the step that ends
            the episode; `DISABLED` leaves it to the caller.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], mode: AutoresetMode) -> None:
        self.env, self._mode = env, mode
        self._has_ended = False

    def reset(self, seed: int | None, options: dict[str, Any] | None) -> tuple[Any, dict[str, Any]]:
        """Starts an episode."""
        self._has_ended = False
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> Outcome:
        """Takes a step, or resets.

        Raises:
            ValueError: If the episode has ended and nobody has reset it.
        """
        if self._has_ended and self._mode is AutoresetMode.DISABLED:
            raise ValueError("the episode has ended: expected reset(options={'reset_mask': ...}) before the next step")
        if self._has_ended and self._mode is AutoresetMode.NEXT_STEP:
            observation, info = self.reset(None, None)
            return Outcome(observation, 0.0, False, False, info)
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._has_ended = terminated or truncated
        if not self._has_ended or self._mode is not AutoresetMode.SAME_STEP:
            return Outcome(observation, float(reward), terminated, truncated, info)
        final = {"final_obs": observation, "final_info": info}
        observation, info = self.reset(None, None)
        self._has_ended = False
        return Outcome(observation, float(reward), terminated, truncated, info, final)
