"""Recipes, by which the bodies of a world are built again in a fresh client, always in the same way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import pybullet

from custom_ros_tools.errors import InterfaceError
from rpbi.bodies import Body, BodyConfig
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.pybullet_world_models import PhysicsChange, SetGravity
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.config.world import WorldConfig
from rpbi.engine.client import Client
from rpbi.world.load_log import LogEntry, apply

MAX_BODY_ID = 100_000
"""Largest body id; unused ids below the largest one are taken and freed while bodies are made."""
_MOMENTARY = pybullet.ACTIVATION_STATE_WAKE_UP | pybullet.ACTIVATION_STATE_SLEEP
"""Flags of `activationState` that act once; others last."""
_PAIRS = (
    (pybullet.ACTIVATION_STATE_ENABLE_SLEEPING, pybullet.ACTIVATION_STATE_DISABLE_SLEEPING),
    (pybullet.ACTIVATION_STATE_ENABLE_WAKEUP, pybullet.ACTIVATION_STATE_DISABLE_WAKEUP),
)
"""Lasting flags that replace each other."""


class BodyRecipe(NamedTuple):
    """A body as it was loaded.

    Attributes:
        name: Its name.
        kind: Its type, a key of BODY_TYPES or `module:Class`.
        config: Its configuration.
        body_id: PyBullet's id of it.
    """

    name: str
    kind: str
    config: BodyConfig
    body_id: int


class Recipe(NamedTuple):
    """Bodies of a world in the order of loading, later changes, and cameras.

    Attributes:
        bodies: The bodies.
        dynamics: Changes of their dynamics: body, link (empty for the root) and change, one for each link.
        physics: Changes of gravity and the engine's parameters.
        cameras: Configurations of the cameras, the first one first.
    """

    bodies: tuple[BodyRecipe, ...]
    dynamics: tuple[tuple[str, str, ChangeDynamics], ...]
    physics: tuple[PhysicsChange, ...]
    cameras: tuple[RgbdSensorConfig, ...]

    @classmethod
    def of(cls, contents: Any) -> Recipe:
        """Returns the shortest recipe for the present `WorldContents`."""
        bodies: Mapping[str, Body] = contents.bodies
        added: dict[str, LogEntry] = {}
        changed: dict[tuple[str, str], dict[str, Any]] = {}
        gravity: SetGravity | None = None
        engine: dict[str, Any] = {}
        engine_kind: Any = None
        for entry in contents.log:
            if entry.what == "add":
                added[entry.name] = entry
            elif entry.what == "remove":
                del added[entry.name]
                changed = {key: value for key, value in changed.items() if key[0] != entry.name}
            elif entry.what == "dynamics":
                link, change = entry.arguments
                _merge(changed.setdefault((entry.name, link), {}), change.kwargs())
            elif isinstance(entry.arguments, SetGravity):
                gravity = entry.arguments
            elif entry.what == "physics":
                engine_kind = type(entry.arguments)
                engine.update(entry.arguments.kwargs())
        physics = (*([gravity] if gravity else ()), *([engine_kind(**engine)] if engine else ()))
        return cls(
            tuple(BodyRecipe(name, *_kind_and_config(added[name]), body.body_id) for name, body in bodies.items()),
            tuple((*key, _change(bodies[key[0]], key[1], values)) for key, values in changed.items()),
            physics,
            tuple(camera.config for camera in contents.cameras.values()),
        )

    def entries(self, pb: Client, config: WorldConfig) -> Iterator[LogEntry]:
        """Yields the entries that build the world in a fresh client; each must be applied before the next is taken.

        Raises:
            InterfaceError: If PyBullet cannot give the bodies these ids.
        """
        yield LogEntry("", "world", config)
        self._reserve_ids(pb)
        for name, kind, body_config, _ in self.bodies:
            yield LogEntry(name, "add", (kind, body_config))
        for name, link, change in self.dynamics:
            yield LogEntry(name, "dynamics", (link, change))
        for physics in self.physics:
            yield LogEntry("", "physics", physics)

    def check_ids(self, bodies: Mapping[str, Body]) -> None:
        """Checks that bodies have the ids that they had.

        Raises:
            InterfaceError: If one has another id.
        """
        for name, _, _, body_id in self.bodies:
            if bodies[name].body_id != body_id:
                raise InterfaceError(f"'{name}': expected PyBullet's id {body_id}, got {bodies[name].body_id}")

    def _reserve_ids(self, pb: Client) -> None:
        """Makes PyBullet give the next bodies the ids that they had: it reuses the id that was freed last."""
        ids = [body.body_id for body in self.bodies]
        if ids == list(range(len(ids))):
            return
        if not 0 <= min(ids) <= max(ids) <= MAX_BODY_ID or len({*ids}) < len(ids):
            raise InterfaceError(f"expected different ids of bodies from 0 to {MAX_BODY_ID}, got {ids}")
        taken = [pb.createMultiBody() for _ in range(max(ids) + 1)]
        for body_id in (*sorted({*taken} - {*ids}, reverse=True), *reversed(ids)):
            pb.removeBody(body_id)


class FreshClient:
    """A copy of the bodies of a world, in a client that has not stepped yet.

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
        """Builds body by body, one for each item.

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
        """Discards the copy."""
        for body in self._bodies.values():
            body.close()
        self.pb.disconnect()


def _kind_and_config(added: LogEntry) -> tuple[str, BodyConfig]:
    kind, config = added.arguments
    return kind, config


def _merge(values: dict[str, Any], change: Mapping[str, Any]) -> None:
    """Applies a change of dynamics on top of others."""
    state = change.get("activationState", 0) & ~_MOMENTARY
    lasting = values.get("activationState", 0)
    for pair in _PAIRS:
        if state & sum(pair):
            lasting = lasting & ~sum(pair) | state & sum(pair)
    values.update(change)
    if "activationState" in values:
        values["activationState"] = lasting


def _change(body: Body, link: str, values: dict[str, Any]) -> ChangeDynamics:
    """Returns the change by which a body that was just loaded gets the present dynamics of a link."""
    if values.keys() & {"mass", "localInertiaDiagonal"}:
        index = next((index for index in body.joint_indices if body.link_name(index) == link), -1)
        mass, _, inertia = body.dynamics_info(index)[:3]
        values = {**values, "mass": mass}
        if all(0.0 < moment < math.inf for moment in inertia):
            values["localInertiaDiagonal"] = tuple(inertia)
    return ChangeDynamics(**values)
