"""Definitions of messages that are nested, belong to other types, or are broken."""

from __future__ import annotations

import random
from pathlib import Path

from robustness.hostile_files.files import spoil_text

from .messages import JOINT_STATE, KNOWN, LINE, joint_state, write_one_topic
from .records import Topic, uint32

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


def nested(rng: random.Random, path: Path) -> None:
    """Nested types, each with several of the next; 11 kB may describe 2^200 values."""
    levels, width = rng.choice((3, 10, 30, 45, 60, 600, 3000)), rng.randint(1, 4)
    length = rng.choice(("", "", "[2]", "[1000000]", "[]"))
    last = rng.choice(("", "uint8 x\n", "string x\n", "float64[0] x\n", "uint8[] x\n"))
    parts = [
        f"{LINE}\nMSG: a_msgs/T{level}\n" + "".join(f"T{level + 1}{length} f{field}\n" for field in range(width))
        for level in range(1, levels)
    ]
    top = "".join(f"T1{length} f{field}\n" for field in range(width))
    definition = top + "".join(parts) + f"{LINE}\nMSG: a_msgs/T{levels}\n{last}"
    write_one_topic(path, Topic("/a", "a_msgs/A", definition), b"", bytes(rng.choice((1, 1000, 100_000))), b"\1" * 1000)


def empties(rng: random.Random, path: Path) -> None:
    element = rng.choice(("E", "float64", "string", "B", "time", "uint8"))
    number = rng.choice((0, 1, 1000, 2_000_000_000, 4294967296, 9999999999, "9" * 5000))
    definition = f"{element}[{number}] x\n{LINE}\nMSG: a_msgs/E\n{LINE}\nMSG: a_msgs/B\nE[2000000000] e\nuint8 y\n"
    write_one_topic(path, Topic("/a", "a_msgs/A", definition), b"", bytes(1000), uint32(2**32 - 1) * 100)


def known(rng: random.Random, path: Path) -> None:
    """Types with special rows, with other definitions."""
    definition = _random_fields(rng)
    for name in ("a_msgs/B", "a_msgs/E", "std_msgs/Header"):
        definition += f"{LINE}\nMSG: {name}\n{_random_fields(rng, 'B') if name != 'a_msgs/E' else ''}"
    definition = definition.replace(" B", " a_msgs/B")
    name = rng.choice(KNOWN)
    raws = [_random_raw(rng) for _ in range(20)]
    write_one_topic(path, Topic("/a", name, _with_package(definition)), *raws)


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


def spoilt_definition(rng: random.Random, path: Path) -> None:
    code = f'string x:str;__import__("os").mknod("{path.parent / "canary"}");y=1\n'
    evil = (code, "bool X=" + "(" * 5000 + "\n", f"int8 X={'9' * 5000}\n", "string s\n" * 30000, "A a\n", "B b\n")
    evil = (*evil, "x" * 2_000_000, f"string {'x' * 70_000}\n", "\0 \0\n", f"{LINE}\nMSG: a_msgs/A\nuint8 x\n")
    definition = spoil_text(rng, JOINT_STATE) if rng.randrange(2) else rng.choice(evil) + JOINT_STATE
    write_one_topic(path, Topic("/a", "sensor_msgs/JointState", definition), *[joint_state(["a"])] * 5)
