"""Bags of recorded sessions with other worlds, commands and states."""

from __future__ import annotations

import io
import json
import random
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

from robustness.hostile_files.files import REPLACED, spoil_text, write_session
from ros_pybullet_interface.msg import SimulationState, WorldCommand, WorldCommands
from rpbi_data.bags.bag_file import BagFile

from .records import Bag, Topic, text


@cache
def recorded_session() -> bytes:
    """Returns the bag of a recorded session."""
    with tempfile.TemporaryDirectory() as folder:
        write_session(Path(folder) / "session.bag", Path(folder))
        return (Path(folder) / "session.bag").read_bytes()


def _session_with(path: Path, change: Callable[[str, bytes], list[bytes]]) -> None:
    """Writes the session with other messages, see `rewrite`."""
    path.write_bytes(recorded_session())
    rewrite(path, change)


def rewrite(path: Path, change: Callable[[str, bytes], list[bytes]]) -> None:
    """Gives a bag other messages; `change` gets the topic and a message, and returns the replacement."""
    with path.open("rb") as file:
        bag = BagFile(file)
        found = [(number, time_ns, raw) for number, raw, time_ns in bag.messages(bag.connections)]
    numbers = {number: index for index, number in enumerate(bag.connections)}
    topics = [Topic(each.topic, each.datatype, each.definition, each.md5sum) for each in bag.connections.values()]
    changed = [
        (numbers[number], time_ns, new)
        for number, time_ns, raw in found
        for new in change(bag.connections[number].topic, raw)
    ]
    Bag(topics, [changed]).write(path)


def world_descriptions(rng: random.Random, path: Path) -> None:
    old, new = rng.choice((*REPLACED, *NUMBERS_OF_WORLDS, None, None) + (None,) * 8) or ("", "")

    def change(topic: str, raw: bytes) -> list[bytes]:
        if topic != "/rpbi/world_description":
            return [raw]
        original = raw[4:].decode()
        return [text(original.replace(old, new) if old else spoil_text(rng, original))] * rng.choice((1, 1, 1, 2, 0))

    _session_with(path, change)


NUMBERS_OF_WORLDS = (
    ('\\"timeStep\\":0.001', '\\"timeStep\\":1e-300'),
    ('\\"timeStep\\":0.001', '\\"timeStep\\":1e300'),
    ('"format": 1', '"format": ' + "[" * 100_000),
    ('"format": 1', '"format": ' + "9" * 5000),
    ('"objects": [', '"objects": [' + "{}," * 1000),
    ('\\"basePosition\\"', '\\"basePosition\\":[1e308,0,0],\\"x\\"'),
    ('\\"mass\\"', '\\"mass\\":-1,\\"y\\"'),
)
"""Other numbers of a recorded world."""
COMMANDS = (
    "input",
    "add",
    "remove",
    "dynamics",
    "attach",
    "physics",
    "sensor_rate",
    "halt",
    "teleport",
    "push",
    "follow",
    "move",
    "x",
)
PHYSICS = ("numSolverIterations", "numSubSteps", "fixedTimeStep", "solverResidualThreshold", "erp", "maxNumCmdPer1ms")
DATA = (
    *("null", "[]", "{}", "nan", "[1e308,NaN,Infinity]", "[" * 100_000, '"' + "%n" * 5000 + '"', "9" * 5000, "{"),
    *('{"os:system":["touch canary"]}', '{"rpbi.geometry:Pose":[[1,2],[3]]}', '{"pairs":[[[],[]]]}', '{"pairs":1}'),
    *('{"rpbi.config.world:WorldConfig":{}}', '["dynamic",{"name":"ball"}]', '["visual",{"pairs":[["name","x"]]}]'),
)


def commands_and_states(rng: random.Random, path: Path) -> None:
    """Commands and states that no world had."""

    def change(topic: str, raw: bytes) -> list[bytes]:
        if topic == "/rpbi/commands":
            physics = json.dumps({"pairs": [[rng.choice(PHYSICS), rng.choice((0, -1, 1e308, 2**31 - 1, 2**70, "x"))]]})
            rows = [
                WorldCommand(rng.choice((0, 3, 2**32)), rng.choice(("ball", "", "x" * 300)), rng.choice(COMMANDS), data)
                for data in [*rng.choices(DATA, k=rng.randint(1, 5)), physics]
            ]
            return [serialised(WorldCommands(commands=rows, first=rng.choice((0, 0, 0, 2**31))))]
        if topic == "/rpbi/state" and rng.randrange(3) == 0:
            state = SimulationState().deserialize(raw)
            state.tick = rng.choice((state.tick, 2**63, 2**64 - 1))
            state.commands = rng.choice((0, 1, 2**31))
            state.state_hash = rng.choice((state.state_hash, "x", "x" * 10_000))
            return [serialised(state)] * rng.choice((1, 50))
        return [raw]

    _session_with(path, change)


def serialised(message: WorldCommands | SimulationState) -> bytes:
    """Returns the bytes of a message."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()
