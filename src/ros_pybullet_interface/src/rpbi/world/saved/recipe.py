"""Recipes, from which the bodies of a world are built again in a fresh PyBullet client, always in the same way."""

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
"""Largest allowed body id. It limits the work of `_reserve_ids`, which makes a temporary body for each id."""
_MOMENTARY = pybullet.ACTIVATION_STATE_WAKE_UP | pybullet.ACTIVATION_STATE_SLEEP
"""Flags of `activationState` that have a momentary effect; all other flags stay in effect."""
_PAIRS = (
    (pybullet.ACTIVATION_STATE_ENABLE_SLEEPING, pybullet.ACTIVATION_STATE_DISABLE_SLEEPING),
    (pybullet.ACTIVATION_STATE_ENABLE_WAKEUP, pybullet.ACTIVATION_STATE_DISABLE_WAKEUP),
)
"""Pairs of lasting flags that replace each other."""


class BodyRecipe(NamedTuple):
    """Data from which a body was loaded.

    Attributes:
        name: Name of the body.
        kind: Type of the body: a key of BODY_TYPES, or `module:Class`.
        config: Configuration of the body.
        body_id: PyBullet's id of the body.
    """

    name: str
    kind: str
    config: BodyConfig
    body_id: int


class Recipe(NamedTuple):
    """The bodies of a world, the changes since the bodies were loaded, and the cameras.

    Attributes:
        bodies: The bodies in the order of loading.
        dynamics: For each link with changed dynamics: name of the body, name of the link (empty for the root link), and
            new values.
        physics: Changes of gravity and of the engine's parameters.
        cameras: Configurations of the cameras in the order of adding.
    """

    bodies: tuple[BodyRecipe, ...]
    dynamics: tuple[tuple[str, str, ChangeDynamics], ...]
    physics: tuple[PhysicsChange, ...]
    cameras: tuple[RgbdSensorConfig, ...]

    @classmethod
    def of(cls, contents: Any) -> Recipe:
        """Returns a recipe for the present state of `WorldContents`, in which successive changes are merged."""
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
        """Yields the load log entries that build the world; each must be applied before the next one is requested.

        Args:
            pb: Fresh client, in which the entries are applied.
            config: Configuration of the world.

        Raises:
            InterfaceError: If the body ids of the recipe are not valid.
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
        """Checks that the built bodies have the same body ids as in the recipe.

        Raises:
            InterfaceError: If a body has another id.
        """
        for name, _, _, body_id in self.bodies:
            if bodies[name].body_id != body_id:
                raise InterfaceError(f"'{name}': expected PyBullet's id {body_id}, got {bodies[name].body_id}")

    def _reserve_ids(self, pb: Client) -> None:
        """Makes PyBullet assign the ids in the recipe to the next bodies.

        Creates temporary bodies and removes them in a suitable order, since PyBullet reuses the last freed id first.
        """
        ids = [body.body_id for body in self.bodies]
        if ids == list(range(len(ids))):
            return
        if not 0 <= min(ids) <= max(ids) <= MAX_BODY_ID or len({*ids}) < len(ids):
            raise InterfaceError(f"expected different ids of bodies from 0 to {MAX_BODY_ID}, got {ids}")
        taken = [pb.createMultiBody() for _ in range(max(ids) + 1)]
        for body_id in (*sorted({*taken} - {*ids}, reverse=True), *reversed(ids)):
            pb.removeBody(body_id)


class FreshClient:
    """A fresh PyBullet client, in which the bodies of a world are built from a recipe.

    Args:
        recipe: Recipe of the bodies.
        config: Configuration of the world.
    """

    def __init__(self, recipe: Recipe, config: WorldConfig) -> None:
        self.recipe = recipe
        self.pb = Client()
        self._config = config
        self._bodies: dict[str, Body] = {}

    def build(self) -> Iterator[None]:
        """Builds the bodies from the recipe's load log entries; yields after applying each entry.

        Raises:
            ConfigError: If a body cannot be loaded again, for instance because its file is missing.
            InterfaceError: If PyBullet refuses a body.
        """
        for entry in self.recipe.entries(self.pb, self._config):
            apply(self.pb, self._bodies, entry)
            yield
        self.recipe.check_ids(self._bodies)
        for body in self._bodies.values():
            body.close()

    def close(self) -> None:
        """Closes the bodies and disconnects the client."""
        for body in self._bodies.values():
            body.close()
        self.pb.disconnect()


def _kind_and_config(added: LogEntry) -> tuple[str, BodyConfig]:
    kind, config = added.arguments
    return kind, config


def _merge(values: dict[str, Any], change: Mapping[str, Any]) -> None:
    """Merges a change of dynamics into `values`, the merged earlier changes of the same link."""
    state = change.get("activationState", 0) & ~_MOMENTARY
    lasting = values.get("activationState", 0)
    for pair in _PAIRS:
        if state & sum(pair):
            lasting = lasting & ~sum(pair) | state & sum(pair)
    values.update(change)
    if "activationState" in values:
        values["activationState"] = lasting


def _change(body: Body, link: str, values: dict[str, Any]) -> ChangeDynamics:
    """Returns the change of dynamics that makes a link of a newly loaded body equal to the same link of `body`.

    Args:
        body: The present body.
        link: Name of the link; empty for the root link.
        values: All dynamics values of the link that were changed since the body was loaded.
    """
    if values.keys() & {"mass", "localInertiaDiagonal"}:
        index = next((index for index in body.joint_indices if body.link_name(index) == link), -1)
        mass, _, inertia = body.dynamics_info(index)[:3]
        values = {**values, "mass": mass}
        if all(0.0 < moment < math.inf for moment in inertia):
            values["localInertiaDiagonal"] = tuple(inertia)
    return ChangeDynamics(**values)
