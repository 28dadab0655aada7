"""Calls tasks and checks the results: a task from another package may fail or return invalid values."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from custom_ros_tools.errors import shortened
from rpbi.plugins import is_foreign, raise_plugin_error

from .task import WorldTask


class CheckedTask:
    """Wraps a task and checks the values that it returns.

    An error in a task from another package becomes a PluginError that names the class, the method, and the number of
    the action in the episode.

    Args:
        task: The wrapped task.

    Raises:
        PluginError: From all methods, if a task from another package fails or returns an invalid value.
    """

    def __init__(self, task: WorldTask) -> None:
        self.task = task
        self.count = 0
        """Number of actions in the episode so far."""
        self._checks_space = is_foreign(task) or type(task).observation is not WorldTask.observation
        self.action_space = self._call("action_space", lambda: _space(task.action_space))
        self.observation_space = self._call("observation_space", lambda: _space(task.observation_space))

    def reset(self, random: np.random.Generator) -> None:
        """Prepares an episode."""
        self.count = 0
        self._call("reset", self.task.reset, random)

    def act(self, action: Any) -> None:
        """Applies an action to the world."""
        self._call("act", self.task.act, action)

    @property
    def watches(self) -> bool:
        """Whether the task evaluates every tick."""
        return type(self.task).after_tick is not WorldTask.after_tick

    @property
    def ends_otherwise(self) -> bool:
        """Whether episodes can end without success."""
        return type(self.task).has_ended is not WorldTask.has_ended

    def after_tick(self) -> None:
        """Calls the task's `after_tick`."""
        self._call("after_tick", self.task.after_tick)

    def observation(self) -> Any:
        """Returns the present observation, after a check that it is in the observation space."""
        return self._call("observation", self._observation)

    def reward(self) -> float:
        """Returns the reward, a finite number."""
        return float(self._call("reward", self._reward))

    def has_succeeded(self) -> bool:
        """Returns whether the task is done."""
        return bool(self._call("has_succeeded", self._truth, self.task.has_succeeded))

    def has_ended(self) -> bool:
        """Returns whether the episode is over."""
        return bool(self._call("has_ended", self._truth, self.task.has_ended))

    def _call(self, method: str, call: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return call(*arguments)
        except Exception as error:
            raise_plugin_error(self.task, f"{method} at action {self.count}", error)
            raise

    def _reward(self) -> float:
        value = self.task.reward()
        if type(value) is not float:
            value = _number(value)
        if not math.isfinite(value):
            raise ValueError(f"expected a finite number, got {value!r}")
        return value

    def _truth(self, ask: Callable[[], Any]) -> bool:
        value = ask()
        if not isinstance(value, (bool, np.bool_)):
            raise TypeError(f"expected True or False, got {value!r}")
        return bool(value)

    def _observation(self) -> Any:
        found = self.task.observation()
        if self._checks_space:
            for problem in problems(self.observation_space, found):
                raise ValueError(problem)
        return found


def problems(space: spaces.Space[Any], value: Any, key: str = "observation") -> list[str]:
    """Compares a value with a space, and returns a message for each mismatch; empty if the value is in the space.

    A message begins with `key`, followed by the keys that lead to the mismatch inside a dictionary.
    """
    if isinstance(space, spaces.Dict):
        if not isinstance(value, dict) or value.keys() != space.spaces.keys():
            got = sorted(value) if isinstance(value, dict) else type(value).__name__
            return [f"{key}: expected a dict of {sorted(space.spaces)}, got {got}"]
        return [each for name, one in space.spaces.items() for each in problems(one, value[name], f"{key}['{name}']")]
    if isinstance(space, spaces.Box):
        return _box_problems(space, value, key)
    return [] if space.contains(value) else [f"{key}: expected one of {space}, got {value!r}"]


def check_action(space: spaces.Space[Any], action: Any, key: str = "action") -> None:
    """Checks that an action fits an action space. Numbers outside a box are allowed, since tasks clip such numbers.

    Raises:
        ValueError: If the type or shape of the action does not fit the space, or a number in the action is not finite.
    """
    if isinstance(space, spaces.Dict) and isinstance(action, Mapping) and action.keys() == space.spaces.keys():
        for name, one in space.spaces.items():
            check_action(one, action[name], f"{key}['{name}']")
    elif isinstance(space, spaces.Box):
        _check_numbers(space.shape, action, key)
    elif not space.contains(action):
        raise ValueError(f"{key}: expected one of {space}, got {shortened(repr(action))}")


def _check_numbers(shape: tuple[int, ...], given: Any, key: str) -> None:
    try:
        values = np.asarray(given)
    except (TypeError, ValueError):  # lists of different lengths
        values = np.asarray(None)
    if values.dtype.kind not in "biuf":
        raise ValueError(f"{key}: expected numbers of shape {shape}, got {shortened(repr(given))}")
    if values.shape != shape:
        raise ValueError(f"{key}: expected the shape {shape}, got {values.shape}")
    if not np.isfinite(values).all():
        raise ValueError(f"{key}: expected finite numbers, got {shortened(str(values))}")


def _box_problems(space: spaces.Box, value: Any, key: str) -> list[str]:
    if not isinstance(value, np.ndarray):
        return [f"{key}: expected an array of shape {space.shape}, got {type(value).__name__}"]
    if value.shape != space.shape:
        return [f"{key}: expected the shape {space.shape}, got {value.shape}"]
    if value.dtype != space.dtype:
        return [f"{key}: expected {space.dtype}, got {value.dtype}"]
    if not np.isfinite(value).all():
        return [f"{key}: expected finite numbers, got {value}"]
    if (value < space.low).any() or (value > space.high).any():
        return [f"{key}: expected numbers within {space.low} and {space.high}, got {value}"]
    return []


def _space(space: Any) -> spaces.Space[Any]:
    if not isinstance(space, spaces.Space):
        raise TypeError(f"expected a space of gymnasium, got {space!r}")
    return space


def _number(value: Any) -> float:
    is_scalar = isinstance(value, (numbers.Real, np.generic)) or (isinstance(value, np.ndarray) and not value.shape)
    if not is_scalar:
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)
