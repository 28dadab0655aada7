"""Bags with a wrong index, wrong chunks or wrong bytes."""

from __future__ import annotations

import random
import struct
from pathlib import Path

from robustness.hostile_files.files import spoil_bytes

from .messages import DIAGNOSTICS, JOINT_STATE, KNOWN, STEP_NS, joint_state
from .records import Bag, Topic, text, uint32
from .sessions import recorded_session


def false_index(rng: random.Random, path: Path) -> None:
    lies = (0, 1, 13, 2**31 - 1, 2**32 - 1, 2**63, 2**64 - 1, rng.randrange(3000))
    keys = ("size", "count", "chunks", "connections", "index", "position", "offset")
    claims = {key: rng.choice(lies) for key in rng.sample(keys, rng.randint(0, 2))}
    repeats = {key: rng.choice((2, 100, 3000)) for key in rng.sample(("entries", "infos", "connections"), 1)}
    if rng.randrange(2):
        repeats = {}
    head = rng.choice(({}, {}, {"encryptor": b"rosbag/AesCbcEncryptor", "gpg_user": b"a", "encrypted_key": b"x"}))
    if rng.randrange(8) == 0:
        head = {f"f{index}": b"" for index in range(200_000)}
    states = [(0, 10**9 + index * STEP_NS, joint_state(["a"])) for index in range(rng.choice((1, 500)))]
    topic = Topic("/a", "sensor_msgs/JointState", JOINT_STATE)
    compression = rng.choice(("none", "bz2", "lz4", "zip"))
    Bag([topic], [states] * rng.choice((1, 2, 50)), compression, claims, repeats, head).write(path)


def large_chunks(rng: random.Random, path: Path) -> None:
    """Chunks that expand beyond their length, or beyond the given one; messages that span chunks."""
    size = rng.choice((1_000_000, 30_000_000))
    chunks = []
    for chunk in range(rng.choice((1, 2))):
        small = [(0, 10**9 + index * 2 + chunk, text("a")) for index in range(rng.choice((1, 500)))]
        chunks.append([*small, (0, 10**12, text(b"x" * size))])
    claims = rng.choice(({}, {"size": 1000}, {"size": 2**32 - 1}))
    Bag([Topic("/a", "std_msgs/String", "string data\n")], chunks, rng.choice(("bz2", "lz4")), claims).write(path)


def changed_bytes(rng: random.Random, path: Path) -> None:
    """A good bag, with some bytes changed."""
    if rng.randrange(2):
        path.write_bytes(recorded_session())
    else:
        topics = [Topic("/a", "sensor_msgs/JointState", JOINT_STATE), Topic("/d", KNOWN[3], DIAGNOSTICS)]
        states = [(0, 10**9 + index * STEP_NS, joint_state(["a", "b"], stamp_s=index)) for index in range(300)]
        status = struct.pack("<III", 0, 1, 0) + text("") + uint32(1) + b"\0" + text("n") * 3
        states.append((1, 10**9, status + uint32(1) + text("k") + text("v")))
        Bag(topics, [states[:100], states[100:]], rng.choice(("none", "bz2", "lz4"))).write(path)
    path.write_bytes(spoil_bytes(rng, path.read_bytes(), least=13))
