"""Fast resets: restores the start state of a world without loading its bodies again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import pybullet
from pydantic.alias_generators import to_camel

from rpbi.bodies import Body
from rpbi.bodies.dynamics import LinkDynamics, read_dynamics
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.engine.client import MAXIMAL_COORDINATES, Client
from rpbi.plugins import is_foreign

from .contents import WorldContents
from .saved.command_log import MAX_KEPT, CommandLog, WorldCommand

MAX_LOGGED = 1_000
"""Maximum number of new load log entries for a fast reset. With more, the world is built again to shorten the log."""
MAX_FREE = 1
"""Maximum number of free bodies for a fast reset; worlds with more free bodies are always built again."""
APART_M = 1_000.0
"""Distance [m] between the bases of bodies at which bodies certainly do not touch."""
NO_TURN = (0.0, 0.0, 0.0, 1.0)
UNDONE = ("halt", "pause", "move", "stop_motion", "set_joint_state")
"""Kinds of commands whose effects are undone by restoring the state, for all command values."""
_SLEEPING = pybullet.ACTIVATION_STATE_ENABLE_SLEEPING | pybullet.ACTIVATION_STATE_SLEEP
_FIELDS = {to_camel(field): field for field in LinkDynamics._fields}


class DynamicsChange(NamedTuple):
    """A change of a link's dynamics: name of the body, name of the link (empty for the root link), and new values."""

    name: str
    link: str
    change: ChangeDynamics


class StartState:
    """The state of a world before its first tick, saved in PyBullet's memory.

    PyBullet's `restoreState` restores this state bit by bit. At later ticks, `restoreState` would lose the history of
    contacts, but before the first tick contacts have no history. Motor targets and dynamics are not part of PyBullet's
    saved state: `restore` restarts the robots, and undoes changes of dynamics. After any other change, the world has
    to be built again.

    A world is not suitable if its bodies may sleep, since PyBullet does not restore sleep. Worlds with several free
    bodies are not suitable either. PyBullet solves contacts in the order of the body pairs in collision detection, and
    does not restore this order. In a test, one of 164 random heaps of bodies moved differently for this reason.

    Args:
        pb: Client of the world.
        contents: Contents of the world at tick 0.
    """

    def __init__(self, pb: Client, contents: WorldContents) -> None:
        self._pb, self._contents = pb, contents
        self._state_id: int = pb.saveState()
        self._logged = len(contents.log)
        self._dynamics = {
            (body.name, link): read_dynamics(body, link) for body in contents.bodies.values() for link in body.links
        }

    @staticmethod
    def suits(contents: WorldContents) -> bool:
        """Returns whether the start state of a world can be restored exactly, see `StartState`."""
        bodies = contents.bodies.values()
        others = (is_foreign(each) or each.is_soft or _is_rigid(each) or _may_sleep(each) for each in bodies)
        if any(others) or contents.attachments.configs or contents.sensors.keep_state:
            return False
        return sum(map(_is_free, bodies)) <= MAX_FREE

    def restore(self, commands: CommandLog) -> bool:
        """Restores the start state if the commands since the start can be undone.

        Args:
            commands: All commands since the start.

        Returns:
            Whether the state was restored; otherwise the world has to be built again.
        """
        if len(self._contents.log) - self._logged > MAX_LOGGED or commands.count > MAX_KEPT:
            return False
        undoing = list(self._undoing(commands))
        if None in undoing:
            return False
        self._end_contacts()
        self._pb.restoreState(self._state_id)
        self._contents.contacts.invalidate()
        for each in filter(None, undoing):
            self._contents.change_dynamics(*each)
        return all([body.restart() for body in self._contents.bodies.values()])

    def close(self) -> None:
        """Deletes the saved state from PyBullet's memory."""
        self._pb.removeState(self._state_id)

    def _end_contacts(self) -> None:
        """Moves all bodies far apart, so that PyBullet drops their contacts; `restoreState` would keep the contacts."""
        for index, body in enumerate(self._contents.bodies.values()):
            self._pb.resetBasePositionAndOrientation(body.body_id, (0.0, 0.0, APART_M * (index + 1)), NO_TURN)
        self._pb.performCollisionDetection()

    def _undoing(self, commands: CommandLog) -> Iterator[DynamicsChange | None]:
        """Yields the changes of dynamics that undo `dynamics` commands; None for each command that cannot be undone."""
        for command in commands.since(0)[1]:
            if command.what == "dynamics" and not command.tick:  # after tick 0, a change may have renewed contacts
                yield self._undo_dynamics(command.name, command.value)
            elif not self._is_undone(command):
                yield None

    def _is_undone(self, command: WorldCommand) -> bool:
        if command.what == "input":
            name, _, key = command.name.partition("/")
            return key == "target" or name in self._contents.cameras  # cameras keep their poses
        if command.what == "teleport":
            return self._contents.bodies[command.name].object_tf is None
        return command.what in UNDONE

    def _undo_dynamics(self, object_name: str, change: ChangeDynamics) -> DynamicsChange | None:
        name, _, link = object_name.partition("/")
        at_start = self._dynamics.get((name, link))
        keys = change.kwargs().keys()
        if at_start is None or not keys <= _FIELDS.keys():
            return None
        values: dict[str, Any] = {key: getattr(at_start, _FIELDS[key]) for key in keys}
        if "mass" in values:
            values["localInertiaDiagonal"] = at_start.local_inertia_diagonal
        if any(value == -1.0 for value in values.values()):  # -1 means that it was not set; PyBullet cannot unset it
            return None
        return DynamicsChange(name, link, ChangeDynamics(**values))


def _is_rigid(body: Body) -> bool:
    """Returns whether a body has maximal coordinates, which `restoreState` does not support."""
    return bool(body.dynamics_info(-1)[10] == MAXIMAL_COORDINATES)


def _may_sleep(body: Body) -> bool:
    """Returns whether PyBullet may put a body to sleep; `restoreState` does not restore sleep."""
    config: Any = getattr(body, "config", None)
    state = getattr(getattr(config, "changeDynamics", None), "activationState", None) or 0
    flags = getattr(getattr(config, "loadURDF", None), "flags", None) or 0
    return bool(state & _SLEEPING or flags & pybullet.URDF_ENABLE_SLEEPING)


def _is_free(body: Body) -> bool:
    """Returns whether the base of a body can be moved by forces."""
    return body.has_physics and not getattr(body, "has_fixed_base", False) and body.dynamics_info(-1)[0] > 0.0
