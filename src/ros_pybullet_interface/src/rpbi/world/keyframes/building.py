"""The bodies of a world in a fresh client, built in parts between the ticks of the world."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from typing import Any

from custom_ros_tools.errors import InterfaceError
from rpbi.bodies import Body
from rpbi.config.world import WorldConfig
from rpbi.engine.client import Client
from rpbi.world.load_log import apply
from rpbi.world.saved.recipe import Recipe

log = logging.getLogger(__name__)


class FreshClient:
    """The bodies of a world once more, in a client that has not stepped yet.

    Args:
        recipe: How they are built.
        config: Configuration of the world.
    """

    def __init__(self, recipe: Recipe, config: WorldConfig) -> None:
        self.recipe = recipe
        self.pb = Client()
        self._config = config
        self._bodies: dict[str, Body] = {}

    def build(self) -> Iterator[None]:
        """Builds body by body, each when the next item is asked for.

        Raises:
            ConfigError: If one cannot be loaded any more.
            InterfaceError: If PyBullet refuses.
        """
        for entry in self.recipe.entries(self.pb, self._config):
            apply(self.pb, self._bodies, entry)
            yield
        self.recipe.check_ids(self._bodies)
        for body in self._bodies.values():
            body.close()

    def close(self) -> None:
        """Gives it up."""
        for body in self._bodies.values():
            body.close()
        self.pb.disconnect()


class KeyframeTimer:
    """Makes keyframes of a `World` at a period, a part at each call of `poll`.

    A keyframe that is refused is reported once; there is no other one until the world is reset.

    Args:
        world: The world.
        every_s: Period [s] of the world's time.

    Attributes:
        longest_s: Longest time that a part of the last keyframe took [s].
    """

    def __init__(self, world: Any, every_s: float) -> None:
        self._world = world
        self._ticks: int = max(1, round(every_s / world.clock.dt_s))
        self.longest_s = 0.0
        self._parts: Iterator[None] | None = None
        self._is_refused = False
        self._resets, self._last = world.resets, world.clock.tick

    def poll(self) -> None:
        """Makes the next part, if a keyframe is due or under way."""
        world = self._world
        if world.resets != self._resets:
            self._parts, self._is_refused = None, False
            self._resets, self._last = world.resets, world.clock.tick
        if self._parts is None:
            if self._is_refused or world.clock.tick - self._last < self._ticks:
                return
            self._parts, self.longest_s, self._last = world.keyframe_in_parts(), 0.0, world.clock.tick
        begin_s = time.perf_counter()
        try:
            next(self._parts)
        except StopIteration:
            self._parts = None
        except InterfaceError as error:
            self._parts, self._is_refused = None, True
            log.warning("keyframe_every_s: no keyframe at tick %d, nor later: %s", world.clock.tick, error)
            return
        self.longest_s = max(self.longest_s, time.perf_counter() - begin_s)
        if self._parts is None:
            log.debug("keyframe at tick %d: its longest part took %.3g s", world.clock.tick, self.longest_s)
