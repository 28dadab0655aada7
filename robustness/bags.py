"""Hostile bags, made by a seed: by structure, with lies in definitions, names, lengths and index; and by bytes.

Run by `./rpbi shell -c 'python3 robustness/bags.py'`, it reads 1,000 of them with each reader and with replay, each in
a process of its own, and prints a table of what became of that; the table in docs/security.md is its.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import random
import shutil
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from bag_records import Bag, Topic, text, uint32  # noqa: E402
from bag_trial import READERS, Trial, tried  # noqa: E402
from hostile_files import REPLACED, WORDS, spoil_bytes, spoil_text, write_session  # noqa: E402

from ros_pybullet_interface.msg import SimulationState, WorldCommand, WorldCommands  # noqa: E402
from rpbi_utils.bag_file import BagFile  # noqa: E402

LINE = "=" * 80
HEADER = f"{LINE}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
JOINT_STATE = f"Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER}"
DIAGNOSTICS = (
    f"Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n{HEADER}{LINE}\nMSG: diagnostic_msgs/DiagnosticStatus\n"
    f"byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n{LINE}\n"
    "MSG: diagnostic_msgs/KeyValue\nstring key\nstring value\n"
)
KNOWN = (
    *("sensor_msgs/JointState", "tf2_msgs/TFMessage", "tf/tfMessage", "diagnostic_msgs/DiagnosticArray"),
    *("ros_pybullet_interface/Contacts", "std_msgs/Header", "std_msgs/String"),
)
FIELDS = (
    "header",
    "name",
    "position",
    "velocity",
    "effort",
    "transforms",
    "status",
    "points",
    "time",
    "stamp",
    "values",
)
TYPES = (
    "bool",
    "char",
    "byte",
    "uint8",
    "int64",
    "float32",
    "float64",
    "string",
    "time",
    "duration",
    "Header",
    "E",
    "B",
)
LENGTHS = ("", "", "[]", "[0]", "[1]", "[3]", "[1001]", "[2000000000]", "[99999999999]")
STEP_NS = 1_000_000


class Hostile(NamedTuple):
    """A hostile bag.

    Attributes:
        seed: By which it was made.
        how: What was done.
        path: The file, in a folder of its own; code in it makes `canary` beside it.
    """

    seed: int
    how: str
    path: Path


def hostile_bags(seeds: range, folder: Path) -> Iterator[Hostile]:
    """Yields a hostile bag for each seed; all kinds come equally often."""
    for seed in seeds:
        place = folder / f"bag{seed}"
        place.mkdir()
        how = list(MAKERS)[seed % len(MAKERS)]
        path = place / "some.bag"
        MAKERS[how](random.Random(f"bag {seed}"), path)
        yield Hostile(seed, how, path)


def _one(path: Path, topic: Topic, *raws: bytes, **changes: object) -> None:
    """Writes a bag of one topic, with a chunk for its messages."""
    Bag([topic], [[(0, 10**9 + index * STEP_NS, raw) for index, raw in enumerate(raws)]], **changes).write(path)


# --- Definitions


def _nested(rng: random.Random, path: Path) -> None:
    """Types in types, each with several of the next; 11 kB may stand for 2^200 values."""
    levels, width = rng.choice((3, 10, 30, 45, 60, 600, 3000)), rng.randint(1, 4)
    length = rng.choice(("", "", "[2]", "[1000000]", "[]"))
    last = rng.choice(("", "uint8 x\n", "string x\n", "float64[0] x\n", "uint8[] x\n"))
    parts = [
        f"{LINE}\nMSG: a_msgs/T{level}\n" + "".join(f"T{level + 1}{length} f{field}\n" for field in range(width))
        for level in range(1, levels)
    ]
    top = "".join(f"T1{length} f{field}\n" for field in range(width))
    definition = top + "".join(parts) + f"{LINE}\nMSG: a_msgs/T{levels}\n{last}"
    _one(path, Topic("/a", "a_msgs/A", definition), b"", bytes(rng.choice((1, 1000, 100_000))), b"\1" * 1000)


def _empties(rng: random.Random, path: Path) -> None:
    element = rng.choice(("E", "float64", "string", "B", "time", "uint8"))
    number = rng.choice((0, 1, 1000, 2_000_000_000, 4294967296, 9999999999, "9" * 5000))
    definition = f"{element}[{number}] x\n{LINE}\nMSG: a_msgs/E\n{LINE}\nMSG: a_msgs/B\nE[2000000000] e\nuint8 y\n"
    _one(path, Topic("/a", "a_msgs/A", definition), b"", bytes(1000), uint32(2**32 - 1) * 100)


def _known(rng: random.Random, path: Path) -> None:
    """Types that have rows of their own, with other definitions."""
    definition = _random_fields(rng)
    for name in ("a_msgs/B", "a_msgs/E", "std_msgs/Header"):
        definition += f"{LINE}\nMSG: {name}\n{_random_fields(rng, 'B') if name != 'a_msgs/E' else ''}"
    definition = definition.replace(" B", " a_msgs/B")
    name = rng.choice(KNOWN)
    raws = [_random_raw(rng) for _ in range(20)]
    _one(path, Topic("/a", name, _with_package(definition)), *raws)


def _random_fields(rng: random.Random, without: str = "") -> str:
    names = rng.sample(FIELDS, rng.randint(1, 6))
    types = [each for each in TYPES if each not in (without, "Header" if without else "")]
    return "".join(f"{rng.choice(types)}{rng.choice(LENGTHS)} {name}\n" for name in names)


def _with_package(definition: str) -> str:
    lines = definition.split("\n")
    return "\n".join(f"a_msgs/{line}" if line[:2] in ("B ", "B[", "E ", "E[") else line for line in lines)


def _random_raw(rng: random.Random) -> bytes:
    return rng.choice(
        (
            *(b"", bytes(rng.randrange(200)), rng.randbytes(rng.randrange(300))),
            b"".join(uint32(rng.randrange(4)) for _ in range(rng.randrange(60))),
            uint32(1) * rng.randrange(60) + uint32(2**32 - 1),
        )
    )


def _spoilt_definition(rng: random.Random, path: Path) -> None:
    code = f'string x:str;__import__("os").mknod("{path.parent / "canary"}");y=1\n'
    evil = (code, "bool X=" + "(" * 5000 + "\n", f"int8 X={'9' * 5000}\n", "string s\n" * 30000, "A a\n", "B b\n")
    evil = (*evil, "x" * 2_000_000, f"string {'x' * 70_000}\n", "\0 \0\n", f"{LINE}\nMSG: a_msgs/A\nuint8 x\n")
    definition = spoil_text(rng, JOINT_STATE) if rng.randrange(2) else rng.choice(evil) + JOINT_STATE
    _one(path, Topic("/a", "sensor_msgs/JointState", definition), *[_joint_state(["a"])] * 5)


# --- Names and numbers


def _joint_state(names: list[str | bytes], values: int | None = None, stamp_s: int = 1) -> bytes:
    count = len(names) if values is None else values
    array = uint32(count) + struct.pack(f"<{count}d", *[0.5] * count)
    joints = uint32(len(names)) + b"".join(map(text, names))
    return struct.pack("<III", 0, stamp_s, 0) + text("") + joints + array + uint32(0) + uint32(0)


def _long_names(rng: random.Random, path: Path) -> None:
    size = rng.choice((0, 1, 100, 999, 1000, 5000, 65_535, 65_536, 1_000_000))
    fill = rng.choice(("x", "\u00e4", "\0", ".", "/", "\n", " ", "\u202e", "%n"))
    names = [fill * size, "time", "record_time", "a.b", "", *rng.sample(WORDS, 3)]
    _one(path, Topic("/a", "sensor_msgs/JointState", JOINT_STATE), *[_joint_state(names)] * 3)


def _many_names(rng: random.Random, path: Path) -> None:
    """Columns by the thousand, each in one row."""
    messages, each = rng.choice(((10, 10), (20, 30), (20, 30), (30, 100), (300, 300), (5, 30_000)))
    raws = []
    for index in range(messages):
        values = [text(f"k{index}_{key}") + text("v") for key in range(each)]
        status = b"\0" + text("n") * 3 + uint32(each) + b"".join(values)
        raws.append(struct.pack("<III", 0, index, 0) + text("") + uint32(1) + status)
    if rng.randrange(3) == 0:
        definition, name = JOINT_STATE, "sensor_msgs/JointState"
        raws = [_joint_state([f"j{index}_{joint}" for joint in range(each)]) for index in range(messages)]
    else:
        definition, name = DIAGNOSTICS, "diagnostic_msgs/DiagnosticArray"
    _one(path, Topic("/a", name, definition), *raws)


def _no_two_alike(rng: random.Random, path: Path) -> None:
    """Messages of one size, each with lengths of its own, so that none can be read with another."""
    strings, size = rng.choice(((2, 5000), (20, 1000), (20, 100), (200, 1000)))
    definition = "".join(f"string s{index}\n" for index in range(strings))
    raws = []
    for _ in range(rng.choice((20, 100, 100, 500))):
        cuts = sorted(rng.randrange(size) for _ in range(strings - 1))
        sizes = [b - a for a, b in zip([0, *cuts], [*cuts, size], strict=True)]
        raws.append(b"".join(uint32(each) + b"x" * each for each in sizes))
    _one(path, Topic("/a", "a_msgs/A", definition), *raws, compression=rng.choice(("none", "lz4")))


def _values(rng: random.Random, path: Path) -> None:
    """Many values a message, odd times and broken texts."""
    element = rng.choice(("bool", "string", "time", "Header", "float32", "uint8"))
    definition = f"Header header\nB[] x\n{HEADER}{LINE}\nMSG: a_msgs/B\n{element}[{rng.choice((1, 50, 999))}] y\n"
    head = struct.pack("<III", 0, rng.choice((0, 1, 2**32 - 1)), rng.choice((0, 2**32 - 1))) + text(b"\xff\xfe\0")
    raws = [
        head + uint32(rng.choice((0, 1, 20, 900, 5000))) + bytes(rng.choice((0, 900, 100_000, 2_000_000)))
        for _ in range(4)
    ]
    _one(path, Topic("/a", "a_msgs/A", definition), *raws)


def _topics(rng: random.Random, path: Path) -> None:
    """Topics by the thousand, of one name when it is that of a file, or of names that no file can have."""
    count = rng.choice((1, 10, 10, 200, 1001, 20_001))
    name = rng.choice(("/a", "/" * 300, "../../a", "\0", "a" * 300, "a" * 60_000, "/proc/self", "\n", "ä" * 200, ""))
    count = min(count, 20_000_000 // (len(name) + 200))
    topics = [
        Topic(name + rng.choice(("/", "_", ".")) * (index % 400), "a_msgs/A", "uint8 x\n") for index in range(count)
    ]
    if rng.randrange(4) == 0:
        topics[0].name = b"\xff\xfe"
    if rng.randrange(4) == 0:
        topics[0].more = {"callerid": b"x" * 100_000} | {f"f{index}": b"" for index in range(20_000)}
    if rng.randrange(4) == 0:
        topics[-1].number = rng.choice((0, 2**32 - 1))
    Bag(topics, [[(index, 10**9, b"\1") for index in range(count)]]).write(path)


def _two_types(rng: random.Random, path: Path) -> None:
    """Several types on one topic, so that columns mix texts, numbers, bools and bytes."""
    types = rng.sample(("uint8", "string", "bool", "float64", "time", "uint8[]", "int64", "string[]"), 3)
    topics = [Topic("/a", f"a_msgs/T{index}", f"{each} data\n") for index, each in enumerate(types)]
    raws = [
        (rng.randrange(3), 10**9 + index, rng.choice((b"\1", bytes(8), text("a"), bytes(4)))) for index in range(60)
    ]
    Bag(topics, [raws]).write(path)


# --- Chunks and index


def _index(rng: random.Random, path: Path) -> None:
    lies = (0, 1, 13, 2**31 - 1, 2**32 - 1, 2**63, 2**64 - 1, rng.randrange(3000))
    keys = ("size", "count", "chunks", "connections", "index", "position", "offset")
    claims = {key: rng.choice(lies) for key in rng.sample(keys, rng.randint(0, 2))}
    repeats = {key: rng.choice((2, 100, 3000)) for key in rng.sample(("entries", "infos", "connections"), 1)}
    if rng.randrange(2):
        repeats = {}
    head = rng.choice(({}, {}, {"encryptor": b"rosbag/AesCbcEncryptor", "gpg_user": b"a", "encrypted_key": b"x"}))
    if rng.randrange(8) == 0:
        head = {f"f{index}": b"" for index in range(200_000)}
    states = [(0, 10**9 + index * STEP_NS, _joint_state(["a"])) for index in range(rng.choice((1, 500)))]
    topic = Topic("/a", "sensor_msgs/JointState", JOINT_STATE)
    compression = rng.choice(("none", "bz2", "lz4", "zip"))
    Bag([topic], [states] * rng.choice((1, 2, 50)), compression, claims, repeats, head).write(path)


def _bomb(rng: random.Random, path: Path) -> None:
    """Chunks that unfold to far more than they are, or than they say; messages that go from one to another."""
    size = rng.choice((1_000_000, 30_000_000))
    chunks = []
    for chunk in range(rng.choice((1, 2))):
        small = [(0, 10**9 + index * 2 + chunk, text("a")) for index in range(rng.choice((1, 500)))]
        chunks.append([*small, (0, 10**12, text(b"x" * size))])
    claims = rng.choice(({}, {"size": 1000}, {"size": 2**32 - 1}))
    Bag([Topic("/a", "std_msgs/String", "string data\n")], chunks, rng.choice(("bz2", "lz4")), claims).write(path)


def _bytes(rng: random.Random, path: Path) -> None:
    """A good bag, with some bytes changed."""
    if rng.randrange(2):
        path.write_bytes(_session())
    else:
        topics = [Topic("/a", "sensor_msgs/JointState", JOINT_STATE), Topic("/d", KNOWN[3], DIAGNOSTICS)]
        states = [(0, 10**9 + index * STEP_NS, _joint_state(["a", "b"], stamp_s=index)) for index in range(300)]
        status = struct.pack("<III", 0, 1, 0) + text("") + uint32(1) + b"\0" + text("n") * 3
        states.append((1, 10**9, status + uint32(1) + text("k") + text("v")))
        Bag(topics, [states[:100], states[100:]], rng.choice(("none", "bz2", "lz4"))).write(path)
    path.write_bytes(spoil_bytes(rng, path.read_bytes(), least=13))


# --- Sessions


@cache
def _session() -> bytes:
    """Returns the bag of a recorded session."""
    with tempfile.TemporaryDirectory() as folder:
        write_session(Path(folder) / "session.bag", Path(folder))
        return (Path(folder) / "session.bag").read_bytes()


def _session_with(path: Path, change: Callable[[str, bytes], list[bytes]]) -> None:
    """Writes the session with other messages; `change` gets the topic and a message, and returns what it is to be."""
    path.write_bytes(_session())
    with path.open("rb") as file:
        bag = BagFile(file)
        found = [(number, round(time_s * 1e9), raw) for number, raw, time_s in bag.messages(bag.connections)]
    numbers = {number: index for index, number in enumerate(bag.connections)}
    topics = [Topic(each.topic, each.datatype, each.definition, each.md5sum) for each in bag.connections.values()]
    changed = [
        (numbers[number], time_ns, new)
        for number, time_ns, raw in found
        for new in change(bag.connections[number].topic, raw)
    ]
    Bag(topics, [changed]).write(path)


def _description(rng: random.Random, path: Path) -> None:
    old, new = rng.choice((*REPLACED, *NUMBERS_OF_WORLDS, None, None) + (None,) * 8) or ("", "")

    def change(topic: str, raw: bytes) -> list[bytes]:
        if topic != "/rpbi/world_description":
            return [raw]
        told = raw[4:].decode()
        return [text(told.replace(old, new) if old else spoil_text(rng, told))] * rng.choice((1, 1, 1, 2, 0))

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


def _commands(rng: random.Random, path: Path) -> None:
    """Commands and states that no world had."""

    def change(topic: str, raw: bytes) -> list[bytes]:
        if topic == "/rpbi/commands":
            physics = json.dumps({"pairs": [[rng.choice(PHYSICS), rng.choice((0, -1, 1e308, 2**31 - 1, 2**70, "x"))]]})
            rows = [
                WorldCommand(rng.choice((0, 3, 2**32)), rng.choice(("ball", "", "x" * 300)), rng.choice(COMMANDS), data)
                for data in [*rng.choices(DATA, k=rng.randint(1, 5)), physics]
            ]
            return [_serialised(WorldCommands(commands=rows, first=rng.choice((0, 0, 0, 2**31))))]
        if topic == "/rpbi/state" and rng.randrange(3) == 0:
            state = SimulationState().deserialize(raw)
            state.tick = rng.choice((state.tick, 2**63, 2**64 - 1))
            state.commands = rng.choice((0, 1, 2**31))
            state.state_hash = rng.choice((state.state_hash, "x", "x" * 10_000))
            return [_serialised(state)] * rng.choice((1, 50))
        return [raw]

    _session_with(path, change)


def _serialised(message: WorldCommands | SimulationState) -> bytes:
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


MAKERS: dict[str, Callable[[random.Random, Path], None]] = {
    "types in types": _nested,
    "arrays of nothing": _empties,
    "known types, other definitions": _known,
    "spoilt definitions": _spoilt_definition,
    "long names": _long_names,
    "many columns": _many_names,
    "no two messages alike": _no_two_alike,
    "many values": _values,
    "topics": _topics,
    "several types on a topic": _two_types,
    "index": _index,
    "chunks": _bomb,
    "bytes": _bytes,
    "bytes again": _bytes,
    "world descriptions": _description,
    "commands and states": _commands,
}
"""Changes of a bag by name."""


def main() -> None:
    """Reads the bags; exits with 1 if one of them did what none may do."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    table: dict[str, list[Trial]] = {name: [] for name in READERS}
    with contextlib.suppress(KeyboardInterrupt):  # which prints the table so far
        for hostile in hostile_bags(range(arguments.first, arguments.first + arguments.count), folder):
            trials = {name: tried(read, hostile.path) for name, read in READERS.items()}
            print(f"\r{hostile.seed} {hostile.how:40}", end="", file=sys.stderr, flush=True)
            for name, trial in trials.items():
                table[name].append(trial)
                if not trial.is_fine:
                    print(f"{hostile.seed} ({hostile.how}): {name}: {trial}", flush=True)
            if all(trial.is_fine for trial in trials.values()):
                shutil.rmtree(hostile.path.parent)
    print("| reader | bags | taken | refused | signals | tracebacks | code | longest [s] | most memory [MB] |")
    print("|---" * 9 + "|")
    for name, trials in table.items():
        of = Counter(trial.verdict.split()[0] for trial in trials)
        slowest, largest = max(trial.cpu_s for trial in trials), max(trial.memory_mb for trial in trials)
        bad = of["signal"], of["traceback"] + of["silent"], of["code"]
        cells = name, len(trials), of["taken"], of["refused"], *bad, f"{slowest:.1f}", f"{largest:.0f}"
        print(f"| {' | '.join(map(str, cells))} |")
    fine = all(trial.is_fine for trials in table.values() for trial in trials)
    print("load:", *(f"{load:.1f}" for load in os.getloadavg()))
    if fine:
        shutil.rmtree(folder)
    sys.exit(not fine)


if __name__ == "__main__":
    main()
