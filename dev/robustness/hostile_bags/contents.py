"""Long names, many columns, values and topics, and topics of several types."""

from __future__ import annotations

import random
import struct
from pathlib import Path

from robustness.hostile_files.files import WORDS

from .messages import DIAGNOSTICS, HEADER, JOINT_STATE, LINE, joint_state, write_one_topic
from .records import Bag, Topic, text, uint32


def long_names(rng: random.Random, path: Path) -> None:
    size = rng.choice((0, 1, 100, 999, 1000, 5000, 65_535, 65_536, 1_000_000))
    fill = rng.choice(("x", "\u00e4", "\0", ".", "/", "\n", " ", "\u202e", "%n"))
    names = [fill * size, "time", "record_time", "a.b", "", *rng.sample(WORDS, 3)]
    write_one_topic(path, Topic("/a", "sensor_msgs/JointState", JOINT_STATE), *[joint_state(names)] * 3)


def many_columns(rng: random.Random, path: Path) -> None:
    """Thousands of columns, each in one row."""
    messages, each = rng.choice(((10, 10), (20, 30), (20, 30), (30, 100), (300, 300), (5, 30_000)))
    raws = []
    for index in range(messages):
        values = [text(f"k{index}_{key}") + text("v") for key in range(each)]
        status = b"\0" + text("n") * 3 + uint32(each) + b"".join(values)
        raws.append(struct.pack("<III", 0, index, 0) + text("") + uint32(1) + status)
    if rng.randrange(3) == 0:
        definition, name = JOINT_STATE, "sensor_msgs/JointState"
        raws = [joint_state([f"j{index}_{joint}" for joint in range(each)]) for index in range(messages)]
    else:
        definition, name = DIAGNOSTICS, "diagnostic_msgs/DiagnosticArray"
    write_one_topic(path, Topic("/a", name, definition), *raws)


def no_two_alike(rng: random.Random, path: Path) -> None:
    """Messages of one size with different lengths of their fields, so that each must be read on its own."""
    strings, size = rng.choice(((2, 5000), (20, 1000), (20, 100), (200, 1000)))
    definition = "".join(f"string s{index}\n" for index in range(strings))
    raws = []
    for _ in range(rng.choice((20, 100, 100, 500))):
        cuts = sorted(rng.randrange(size) for _ in range(strings - 1))
        sizes = [b - a for a, b in zip([0, *cuts], [*cuts, size], strict=True)]
        raws.append(b"".join(uint32(each) + b"x" * each for each in sizes))
    write_one_topic(path, Topic("/a", "a_msgs/A", definition), *raws, compression=rng.choice(("none", "lz4")))


def many_values(rng: random.Random, path: Path) -> None:
    """Many values a message, odd times and broken texts."""
    element = rng.choice(("bool", "string", "time", "Header", "float32", "uint8"))
    definition = f"Header header\nB[] x\n{HEADER}{LINE}\nMSG: a_msgs/B\n{element}[{rng.choice((1, 50, 999))}] y\n"
    head = struct.pack("<III", 0, rng.choice((0, 1, 2**32 - 1)), rng.choice((0, 2**32 - 1))) + text(b"\xff\xfe\0")
    raws = [
        head + uint32(rng.choice((0, 1, 20, 900, 5000))) + bytes(rng.choice((0, 900, 100_000, 2_000_000)))
        for _ in range(4)
    ]
    write_one_topic(path, Topic("/a", "a_msgs/A", definition), *raws)


def many_topics(rng: random.Random, path: Path) -> None:
    """Thousands of topics with equal file names, or with names that no file can have."""
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


def several_types(rng: random.Random, path: Path) -> None:
    """Several types on one topic, so that columns mix texts, numbers, bools and bytes."""
    types = rng.sample(("uint8", "string", "bool", "float64", "time", "uint8[]", "int64", "string[]"), 3)
    topics = [Topic("/a", f"a_msgs/T{index}", f"{each} data\n") for index, each in enumerate(types)]
    raws = [
        (rng.randrange(3), 10**9 + index, rng.choice((b"\1", bytes(8), text("a"), bytes(4)))) for index in range(60)
    ]
    Bag(topics, [raws]).write(path)
