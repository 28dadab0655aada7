"""The load log of a world: all changes of bodies and physics, from which the world can be rebuilt."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple

import pybullet

from custom_ros_tools.errors import PhysicsError, UnknownNameError
from rpbi.bodies import BODY_TYPES, Body
from rpbi.bodies.body import MULTI_BODY
from rpbi.bodies.dynamics import change_dynamics
from rpbi.bodies.file_checks import check_files
from rpbi.config.pybullet_world_models import PhysicsChange, SetGravity
from rpbi.config.world import WorldConfig
from rpbi.engine.client import Client
from rpbi.plugins import plugin_errors, raise_plugin_error


def refuse_non_finite(body: Body) -> None:
    """Checks that all masses, poses, joint limits and sizes of a rigid body are finite.

    Numbers that are not finite come from `nan` in a URDF, which PyBullet loads without a warning, or from sizes that
    are too large. Such numbers would spread to all bodies that touch the body.

    Raises:
        PhysicsError: If a number is not finite; the message names the link or joint.
    """
    for fault in _problems(body):
        raise PhysicsError(f"{body.name}: {fault} not finite: is something nan, inf or too large?")


def _problems(body: Body) -> Iterator[str]:
    pb, body_id = body.pb, body.body_id
    links = {index: f"link '{body.link_name(index)}'" for index in (-1, *body.joint_indices)}
    for index, link in links.items():
        mass, _, inertia, position, quat = body.dynamics_info(index)[:5]
        if not _are_finite((mass, *inertia, *position, *quat)):
            yield f"{link}: its mass, inertia or centre of mass is"
    for index in body.joint_indices:
        info = pb.getJointInfo(body_id, index)
        joint = f"joint '{info[1].decode()}'"
        if not _are_finite((*info[6:8], *info[13], *info[14], *info[15])):
            yield f"{joint}: its place, axis, damping or friction is"
        if any(map(math.isnan, info[8:12])):  # a limit may be infinite
            yield f"{joint}: one of its limits is"
    for index, link in links.items():
        if not _are_finite(chain(*pb.getAABB(body_id, index))):
            yield f"{link}: its place or size is"


def _are_finite(numbers: Iterable[float]) -> bool:
    return all(map(math.isfinite, numbers))


_SAME_EVERY_TIME: dict[str, Any] = {
    "deterministicOverlappingPairs": 1,  # otherwise the order of contacts depends on earlier contacts
    "contactBreakingThreshold": 0.02,  # [m] PyBullet's default; a global variable of the process that outlives a client
    "numSubSteps": 0,  # PyBullet's default; a changed value would outlive a reset
    "enableFileCaching": 1,  # PyBullet's default; a changed value would outlive a reset
}


class LogEntry(NamedTuple):
    """A change of the bodies or the physics of a world; picklable.

    Attributes:
        name: Name of the changed body; empty if `what` is `world` or `physics`.
        what: Kind of the change: `world` (set-up), `physics`, `add`, `dynamics` or `remove`.
        arguments: For `world`, the WorldConfig. For `physics`, the PhysicsChange. For `add`, type and configuration of
            the body. For `dynamics`, link name (empty for the root link) and ChangeDynamics. For `remove`, None.
    """

    name: str
    what: str
    arguments: Any = None


class LoadLogReader:
    """Reads the new entries of a load log.

    Args:
        log: The load log, which may grow at any time. A reset of the world clears the log, which then starts again.
    """

    def __init__(self, log: Sequence[LogEntry]) -> None:
        self._log = log
        self._first: LogEntry | None = None
        self._count = 0

    def drain(self) -> tuple[LogEntry, ...]:
        """Returns the entries that were added since the last call; if the log was restarted, returns all entries."""
        if self._log and self._log[0] is not self._first:
            self._first, self._count = self._log[0], 0
        new = tuple(self._log[self._count :])
        self._count += len(new)
        return new


def apply(pb: Client, bodies: dict[str, Body], entry: LogEntry) -> None:
    """Applies an entry of a load log to a world. If adding a body fails, the world is unchanged.

    Args:
        pb: Client of the world.
        bodies: Bodies of the world, indexed by name; this mapping is updated.
        entry: Entry to apply.

    Raises:
        ConfigError: If a body cannot be built as configured.
        PhysicsError: If PyBullet refuses the change.
        PluginError: If a class of another package fails.
        UnknownNameError: If there is no such body or link.
        ValueError: If the change of dynamics is not valid for the link.
    """
    if entry.what in ("remove", "dynamics") and entry.name not in bodies:
        raise UnknownNameError("object", entry.name, list(bodies))
    if entry.what == "world":
        _set_up(pb, entry.arguments)
    elif entry.what == "physics":
        change_physics(pb, bodies.values(), entry.arguments)
    elif entry.what == "remove":
        body = bodies.pop(entry.name)
        for other in bodies.values():
            other.detach(entry.name)
        with plugin_errors(body, f"remove of '{entry.name}'"):
            body.remove()
    elif entry.what == "dynamics":
        change_dynamics(bodies[entry.name], *entry.arguments)
    else:
        kind, config = entry.arguments
        check_files(config)
        before = _body_ids(pb)
        try:
            make: Any = BODY_TYPES.find(kind)  # Any, since the signatures of constructors differ
            body = make(pb, config)
            if not body.is_soft:
                refuse_non_finite(body)
            body.attach(bodies)
            bodies[entry.name] = body
        except BaseException as error:
            for body_id in _body_ids(pb) - before:
                pb.removeBody(body_id)
            if isinstance(error, Exception):
                raise_plugin_error(BODY_TYPES.find(kind), f"making '{entry.name}'", error)
            if isinstance(error, (pybullet.error, OverflowError, SystemError)):  # SystemError: a fault in PyBullet
                raise PhysicsError(f"{entry.name}: {error}") from error
            raise


def replay(pb: Client, entries: Iterable[LogEntry]) -> dict[str, Body]:
    """Rebuilds a world in a client by applying the entries of a load log in order.

    Returns:
        The bodies of the world, indexed by name.
    """
    bodies: dict[str, Body] = {}
    for entry in entries:
        apply(pb, bodies, entry)
    return bodies


def _set_up(pb: Client, config: WorldConfig) -> None:
    """Clears the client, and sets search paths, time step, gravity and the engine's parameters."""
    pb.resetSimulation(**config.resetSimulation.kwargs())
    pb.is_deformable = bool((config.resetSimulation.flags or 0) & pybullet.RESET_USE_DEFORMABLE_WORLD)
    for path in config.setAdditionalSearchPath:
        pb.setAdditionalSearchPath(path)
    pb.setTimeStep(round(config.timeStep * 1e9) / 1e9)
    pb.setPhysicsEngineParameter(**_SAME_EVERY_TIME)
    change_physics(pb, (), config.setGravity)
    change_physics(pb, (), config.setPhysicsEngineParameter)


def change_physics(pb: Client, bodies: Iterable[Body], change: PhysicsChange) -> None:
    """Changes gravity, or parameters of the engine.

    A change of gravity wakes sleeping bodies, which would otherwise not react. Bodies in maximal coordinates are
    not woken, since PyBullet would then let these bodies sleep later even if their sleep is disabled.
    """
    arguments = change.kwargs()
    if isinstance(change, SetGravity):
        for body in bodies:
            if pb.getDynamicsInfo(body.body_id, -1)[10] == MULTI_BODY:
                pb.changeDynamics(body.body_id, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)
        pb.setGravity(**arguments)
        pb.gravity = (change.gravX, change.gravY, change.gravZ)
    elif arguments:
        pb.setPhysicsEngineParameter(**arguments)
    pb.sub_steps = pb.getPhysicsEngineParameters()["numSubSteps"]


def _body_ids(pb: Client) -> set[int]:
    return {pb.getBodyUniqueId(index) for index in range(pb.getNumBodies())}
