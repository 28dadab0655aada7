"""Keyframes: states of a world as text, from which it continues in a fresh client."""

from __future__ import annotations

import base64
import binascii
import json
import re
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

from custom_ros_tools.errors import InterfaceError, shortened
from custom_ros_tools.foreign import load_foreign_json
from rpbi.bodies import Body
from rpbi.control.robot_dynamics import RobotDynamics
from rpbi.engine.client import Client
from rpbi.engine.clock import Clock
from rpbi.kinematics import Kinematics
from rpbi.plugins import is_foreign
from rpbi.sensors.contacts.contacts import ContactReader
from rpbi.urdf.joints import Joint, JointModel
from rpbi.world.contents import WorldContents
from rpbi.world.saved.recipe import FreshClient
from rpbi.world.saved.values import with_present_names

from .graph import GraphReader, GraphWriter
from .motion import BodyMotion, asleep, put_to_sleep

FORMAT = 2
"""Version of the text's layout."""
MAX_BYTES = 1 << 26
"""Largest size of an unpacked keyframe [bytes]."""
MAX_VALUES = 5_000_000
"""Largest number of values in it."""
_FIXED = (Client, Clock, ContactReader, Joint, JointModel, Kinematics, RobotDynamics)
"""Types of objects that are the same whenever a world is built."""
_SENSORS = "sensors"
_JSON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')
"""A text in JSON."""


class Keyframe:
    """A state of a world.

    Attributes:
        tick: The tick.
        recipe: How its bodies are built.
        changed: Names of objects that were added or removed since the world was built or reset.
    """

    def __init__(self, text: str) -> None:
        """Reads a text.

        Raises:
            ValueError: If the text is no keyframe, or is one of another version of this package.
            ConfigError: If it is no JSON or too large, or a configuration in it is not valid here.
        """
        try:
            self._content = load_foreign_json(_unpacked(text), "keyframe", MAX_BYTES, MAX_VALUES)
            if self._content["format"] != FORMAT:
                raise ValueError(f"the keyframe has format {self._content['format']}, this version reads {FORMAT}")
            reader = GraphReader((), {})
            self.tick: int = self._content["tick"]
            plain = reader.value(self._content["bodies"])
            self.recipe, self._motions, self._asleep, self._pushed, self.changed = plain
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"expected a keyframe: {shortened(repr(error))}") from None

    def enter(self, world: Any, contents: WorldContents) -> dict[str, Body]:
        """Brings a `World` that was just built by the recipe to this state.

        Returns:
            The bodies that external wrenches act on.

        Raises:
            ValueError: If the text does not fit the world.
            InterfaceError: If the world has a state that is not in the text: it would not continue as the saved one.
        """
        for name, body in contents.bodies.items():
            self._motions[name].check(body)
        anchors = _anchors(contents)
        reader = GraphReader((*_FIXED, type(world)), anchors)
        for name, attributes in self._content["objects"].items():
            reader.fill(anchors[name], attributes)
        if json.dumps(_objects(world, contents)) != json.dumps(self._content["objects"]):
            raise InterfaceError("the world does not take the state of the keyframe: it was built in another way")
        _enter(self._motions, self._asleep, contents)
        return {name: contents.bodies[name] for name in self._pushed}


def _anchors(contents: WorldContents) -> dict[str, Any]:
    """Returns the objects with names; sensors, whose state influences no motion, come after bodies."""
    return {
        "bodies": contents.bodies,
        **{f"bodies/{name}": body for name, body in contents.bodies.items()},
        "attachments": contents.attachments,
        **{
            f"{_SENSORS}/{name}/{number}": sensor
            for name in (*contents.bodies, *contents.cameras)
            for number, sensor in enumerate(contents.sensors[name])
        },
        _SENSORS: contents.sensors,
    }


def _objects(world: Any, contents: WorldContents) -> dict[str, Any]:
    """Returns the state of all objects of a `World` as plain values.

    Raises:
        InterfaceError: If one cannot be written.
    """
    anchors = _anchors(contents)
    writer = GraphWriter((*_FIXED, type(world)), anchors)
    written = ((name, anchor) for name, anchor in anchors.items() if anchor is not contents.bodies)
    return {name: writer.attributes(anchor, name.removeprefix("bodies/")) for name, anchor in written}


def renamed(text: str, names: Mapping[str, str]) -> str:
    """Returns the text of a keyframe with other names of files.

    Args:
        names: New names by present names.

    Raises:
        ValueError: If the text is no keyframe.
    """
    written = {json.dumps(before): json.dumps(after) for before, after in names.items()}
    return _packed(_JSON_TEXT.sub(lambda match: written.get(match[0], match[0]), _unpacked(text)))


def difference(first: str, second: str) -> str:
    """Returns the first part that differs between two keyframes, empty if none; sensors depend on their receivers."""
    contents = (load_foreign_json(_unpacked(text), "keyframe", MAX_BYTES, MAX_VALUES) for text in (first, second))
    one, other = ({**each["objects"], "bodies": each["bodies"], "tick": each["tick"]} for each in contents)
    names = (name for name in {**one, **other} if not name.startswith(_SENSORS))
    return next((name for name in names if one.get(name) != other.get(name)), "")


def _enter(motions: Mapping[str, BodyMotion], sleepers: tuple[str, ...], contents: WorldContents) -> None:
    """Restores the motion of bodies in a fresh client, and their attachments, motors and sleep."""
    for name, body in contents.bodies.items():
        motions[name].put(body)
    contents.attachments.resume()
    for body in contents.bodies.values():
        body.resume()
    put_to_sleep(contents.bodies, sleepers)
    contents.contacts.invalidate()


def move(world: Any, contents: WorldContents, pushed: Iterable[str], fresh: FreshClient) -> str:
    """Moves a running `World` into a fresh client with its bodies, and returns the keyframe.

    When it raises, nothing has changed.

    Args:
        pushed: Names of the bodies that external wrenches act on.

    Raises:
        InterfaceError: If an object has a state that cannot be written.
    """
    motions = {name: BodyMotion.of(body) for name, body in contents.bodies.items()}
    changed = tuple(sorted(contents.changed_names()))
    objects = _objects(world, contents)
    sleepers = asleep(world.pb, contents.bodies)
    world.pb.become(fresh.pb)
    _enter(motions, sleepers, contents)
    content = {
        "format": FORMAT,
        "tick": world.clock.tick,
        "bodies": GraphWriter((), {}).plain((fresh.recipe, motions, sleepers, tuple(pushed), changed)),
        "objects": objects,
    }
    return _packed(json.dumps(content, separators=(",", ":")))


def refuse(world: Any) -> None:
    """Refuses a world in which PyBullet may have a state that keyframes do not contain.

    Raises:
        InterfaceError: If there is a window, a soft body, or a body of another package.
    """
    if world.pb.has_window:
        raise InterfaceError(
            "a world with a window cannot move into another client: run it with connection_mode DIRECT"
        )
    for name, body in world.bodies.items():
        if body.is_soft:
            raise InterfaceError(f"'{name}' is soft: PyBullet neither reports nor takes the state of soft bodies")
        if is_foreign(body):
            kind = type(body).__name__
            raise InterfaceError(
                f"'{name}' is a {kind} of another package, which may have a state in PyBullet that is not known"
            )


def _packed(text: str) -> str:
    return base64.b64encode(zlib.compress(text.encode(), 1)).decode()


def _unpacked(text: str) -> str:
    """Returns the JSON of a keyframe, with the present names of its classes."""
    try:
        unpacking = zlib.decompressobj()
        data = unpacking.decompress(base64.b64decode(text, validate=True), MAX_BYTES)
    except (binascii.Error, zlib.error) as error:
        raise ValueError(f"expected a keyframe: {error}") from None
    if not unpacking.eof:
        raise ValueError(f"expected a keyframe of at most {MAX_BYTES} bytes")
    return with_present_names(data.decode())
