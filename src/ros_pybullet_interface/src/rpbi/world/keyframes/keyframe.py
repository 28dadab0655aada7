"""Keyframes: texts with the complete state of a world, from which the world continues in a fresh PyBullet client."""

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
"""Version of the layout of keyframe texts."""
MAX_BYTES = 1 << 26
"""Largest size of an unpacked keyframe [bytes]."""
MAX_VALUES = 5_000_000
"""Largest number of values in a keyframe."""
_FIXED = (Client, Clock, ContactReader, Joint, JointModel, Kinematics, RobotDynamics)
"""Types whose objects are not written to keyframes, since building the world creates equal objects."""
_SENSORS = "sensors"
_JSON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')
"""Pattern of a string in JSON."""


class Keyframe:
    """A keyframe that was read from its text.

    Attributes:
        tick: Tick of the keyframe.
        recipe: Recipe for building the world's bodies.
        changed: Names of bodies that had been added or removed since the world was built or reset.
    """

    def __init__(self, text: str) -> None:
        """Reads the text of a keyframe.

        Raises:
            ValueError: If the text is not a keyframe, or was written by an incompatible version of this package.
            ConfigError: If the unpacked text is not JSON or is too large, or a configuration is not valid on this
                machine.
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
        """Sets a `World`, which was just built from the recipe, to the state of the keyframe.

        Returns:
            The bodies on which external wrenches act, indexed by name.

        Raises:
            ValueError: If the keyframe does not fit the world.
            InterfaceError: If the state that the world reaches differs from the keyframe.
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
    """Returns bodies, attachments and sensors, indexed by their names in keyframes.

    Sensors come last, so that the text about bodies and attachments does not depend on sensors.
    """
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
    """Returns the attributes of all anchors of a `World` as plain data, indexed by the anchors' names.

    Raises:
        InterfaceError: If an attribute cannot be written.
    """
    anchors = _anchors(contents)
    writer = GraphWriter((*_FIXED, type(world)), anchors)
    written = ((name, anchor) for name, anchor in anchors.items() if anchor is not contents.bodies)
    return {name: writer.attributes(anchor, name.removeprefix("bodies/")) for name, anchor in written}


def renamed(text: str, names: Mapping[str, str]) -> str:
    """Replaces file names in the text of a keyframe, and returns the new text.

    Args:
        text: Text of the keyframe.
        names: New file names, indexed by present file name.

    Raises:
        ValueError: If the text is not a keyframe.
    """
    written = {json.dumps(before): json.dumps(after) for before, after in names.items()}
    return _packed(_JSON_TEXT.sub(lambda match: written.get(match[0], match[0]), _unpacked(text)))


def difference(first: str, second: str) -> str:
    """Returns where two keyframes first differ: an anchor's name, `bodies` or `tick`; empty if they are equal.

    Sensors are not compared, since their state depends on whether their samples have receivers.
    """
    contents = (load_foreign_json(_unpacked(text), "keyframe", MAX_BYTES, MAX_VALUES) for text in (first, second))
    one, other = ({**each["objects"], "bodies": each["bodies"], "tick": each["tick"]} for each in contents)
    names = (name for name in {**one, **other} if not name.startswith(_SENSORS))
    return next((name for name in names if one.get(name) != other.get(name)), "")


def _enter(motions: Mapping[str, BodyMotion], sleepers: tuple[str, ...], contents: WorldContents) -> None:
    """Restores motion, attachments, motor settings and sleep of the bodies in a fresh client."""
    for name, body in contents.bodies.items():
        motions[name].put(body)
    contents.attachments.resume()
    for body in contents.bodies.values():
        body.resume()
    put_to_sleep(contents.bodies, sleepers)
    contents.contacts.invalidate()


def move(world: Any, contents: WorldContents, pushed: Iterable[str], fresh: FreshClient) -> str:
    """Moves a running `World` into a fresh client, and returns a keyframe of its present state as text.

    Args:
        world: The world.
        contents: Contents of the world.
        pushed: Names of the bodies on which external wrenches act.
        fresh: The fresh client, in which the bodies of the world have been built.

    Raises:
        InterfaceError: If an object has a state that cannot be written. The world is then unchanged.
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
    """Checks that keyframes can contain the complete state of a world.

    Raises:
        InterfaceError: If the world has a window, a soft body, or a body whose class is from another package.
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
    """Returns the JSON of a keyframe's text, with former class names replaced by present names.

    Raises:
        ValueError: If the text is not a keyframe or is too large.
    """
    try:
        unpacking = zlib.decompressobj()
        data = unpacking.decompress(base64.b64decode(text, validate=True), MAX_BYTES)
    except (binascii.Error, zlib.error) as error:
        raise ValueError(f"expected a keyframe: {error}") from None
    if not unpacking.eof:
        raise ValueError(f"expected a keyframe of at most {MAX_BYTES} bytes")
    return with_present_names(data.decode())
