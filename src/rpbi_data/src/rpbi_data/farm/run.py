"""Runs one episode: a policy acts in a world until the episode ends."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from custom_ros_tools.errors import PluginError
from custom_ros_tools.plugins import cause_of, full_name
from rpbi.world import World

from .job import FarmJob
from .policy import Policy

TIMEOUT = "timeout"
"""Label of an episode that its policy did not end within the given number of ticks."""
_WORD = re.compile(r"\w[\w.-]{0,59}")


class EpisodeWriter(Protocol):
    """Interface of objects that write the messages of an episode's world."""

    def start(self) -> None:
        """Writes the state of the world before its first tick."""

    def before_step(self) -> None:
        """Writes the commands that take effect at the next tick."""

    def after_step(self, samples: list[Any]) -> None:
        """Writes the sensor samples of the tick that has just been simulated."""

    def end(self) -> None:
        """Writes the final state of the world."""


class EpisodeRun:
    """Runs one policy in a new world.

    Args:
        job: Job of the farm, which contains the seed and the maximum number of ticks.
        policy: Class of the policy.
        number: Number of the episode, which is part of the random seed.
        world: The world at tick 0.
    """

    def __init__(self, job: FarmJob, policy: type[Policy], number: int, world: World) -> None:
        self._world, self._ticks, self._class = world, job.ticks, policy
        self._seed = (job.seed, number)

    def run(self, writer: EpisodeWriter) -> str:
        """Runs the episode to its end, and returns the label from the policy, or `TIMEOUT`.

        Raises:
            PluginError: If the policy raises an exception, steps or resets the world, or returns an invalid label.
                The message contains the class, method, tick and seed.
            InterfaceError: If the world cannot be simulated or written.
        """
        with self._policy_errors("__init__"):
            policy = self._class(self._world, np.random.default_rng(self._seed))
        writer.start()
        label = self._loop(policy, writer)
        writer.end()
        return label

    def _loop(self, policy: Policy, writer: EpisodeWriter) -> str:
        for _ in range(self._ticks):
            with self._policy_errors("act"):
                label = policy.act()
                if label is not None:
                    return self._checked(label)
                self._world.apply_inputs()
            writer.before_step()
            writer.after_step(self._world.step())
        return TIMEOUT

    def _checked(self, label: Any) -> str:
        if not isinstance(label, str) or not _WORD.fullmatch(label):
            raise ValueError(f"expected a word as label, or None, got {label!r:.60}")
        if self._world.clock.tick == 0:
            raise ValueError(f"expected None before the first tick, got the label '{label}'")
        return label

    @contextmanager
    def _policy_errors(self, method: str) -> Iterator[None]:
        """Converts exceptions from the policy to a `PluginError` that names the policy."""
        world = self._world
        tick, resets = world.clock.tick, world.resets
        doing = f"{method} at tick {tick} with the seed {self._seed}"
        try:
            yield
            if (world.clock.tick, world.resets) != (tick, resets):
                raise ValueError("expected a policy that neither steps nor resets the world")
        except (Exception, SystemExit) as error:
            raise PluginError(full_name(self._class), doing, cause_of(error)) from error
