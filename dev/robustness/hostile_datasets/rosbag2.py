"""Hostile recordings of rosbag2, in MCAP and SQLite."""

from __future__ import annotations

import random
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from .values import CANARY, change_bytes, facts, odd_value, special_entries, spoil

MAGIC = b"\x89MCAP0\r\n"
DATABASE = "recording.db3"


def _recording(folder: Path) -> Path:
    return sorted(folder.glob("*/metadata.yaml"))[0].parent


def _write_metadata(path: Path, data: Any) -> None:
    try:
        path.write_text(yaml.safe_dump(data))
    except RecursionError:
        path.write_text("[" * 5000)


def metadata(folder: Path, chance: random.Random) -> None:
    path = _recording(folder) / "metadata.yaml"
    data = yaml.safe_load(path.read_text())
    for _ in range(chance.randint(1, 3)):
        data = spoil(data, chance)
    _write_metadata(path, data)


def paths(folder: Path, chance: random.Random) -> None:
    """Names files outside of the recording, and other storages."""
    path = _recording(folder) / "metadata.yaml"
    data = yaml.safe_load(path.read_text())
    info = data["rosbag2_bagfile_information"]
    way = chance.randrange(3)
    if way == 0:
        names = (
            "../../../etc/passwd",
            "/etc/passwd",
            "/dev/zero",
            ".",
            "..",
            "",
            "../" + CANARY,
            "\x1b[2J",
            "x" * 3000,
        )
        info["relative_file_paths"] = [chance.choice(names)] * chance.choice((1, 2, 1000))
    elif way == 1:
        info["storage_identifier"] = chance.choice(("sqlite3", "canary_module:Canary", "", "mcap2", "\x1b[2J"))
    else:
        info["compression_format"] = chance.choice(("zstd", "canary_module", "lz4"))
        info["compression_mode"] = chance.choice(("FILE", "MESSAGE", "file", "message", "STORAGE"))
    _write_metadata(path, data)


def yaml_text(folder: Path, chance: random.Random) -> None:
    """Has tags of Python, aliases that unfold, and deep levels."""
    levels = "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12))
    canary = folder.parent / CANARY
    texts = (
        f"!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{canary}']]",
        f"rosbag2_bagfile_information: !!python/object/apply:os.system ['touch {canary}']",
        "a0: &a0 x\n" + levels,
        f"a0: &a0 x\n{levels}rosbag2_bagfile_information: *a11",
        "[" * 20_000,
        "&a [*a]",
        "? " * 3000,
        "\x00",
        "",
        "rosbag2_bagfile_information: {version: 9, storage_identifier: mcap}",
        "1: " + "9" * 100_000,
    )
    (_recording(folder) / "metadata.yaml").write_text(chance.choice(texts))


def records(folder: Path, chance: random.Random) -> None:
    """Changes the records of an MCAP file: lengths, order, number and content."""
    (path,) = _recording(folder).glob("*.mcap")
    data, at, found = path.read_bytes(), len(MAGIC), []
    while at + 9 < len(data) - len(MAGIC):
        (size,) = struct.unpack_from("<Q", data, at + 1)
        found.append((data[at], size, bytearray(data[at + 9 : at + 9 + size])))
        at += 9 + size
    for _ in range(chance.randint(1, 4)):
        index = chance.randrange(len(found))
        kind, size, content = found[index]
        way = chance.randrange(6)
        if way == 0:
            found[index] = kind, chance.choice((2**63, 2**40, 0, 1, size + 8, 2**64 - 1)), content
        elif way == 1 and content:
            spot = chance.randrange(len(content))
            content[spot : spot + 8] = chance.choice(
                (b"\xff" * 8, struct.pack("<Q", 2**40), b"\0" * 8, b"\x1b[2J\x07abc")
            )
        elif way == 2:
            found[index] = chance.randrange(256), size, content
        elif way == 3:
            found += [found[index]] * chance.choice((1, 1000))
        elif way == 4:
            del found[index]
            if not found:
                break
        else:
            chance.shuffle(found)
    body = b"".join(struct.pack("<BQ", kind, size) + bytes(content) for kind, size, content in found)
    path.write_bytes(MAGIC + body + MAGIC)


def chunk(folder: Path, chance: random.Random) -> None:
    """Has a chunk that unfolds to very much, or is of another compression than it says."""
    import lz4.frame

    size = chance.choice((10**6, 2 * 10**9))
    plain = bytes(min(size, 300_000_000))
    text = chance.choice((b"lz4", b"zstd", b"", b"none", b"\x1b[2J"))
    packed = lz4.frame.compress(plain) if text == b"lz4" else plain[:1000]
    head = struct.pack("<QQQII", 0, 2**63 - 1, chance.choice((size, 10, 2**62)), 0, len(text)) + text
    content = head + struct.pack("<Q", len(packed)) + packed
    header = struct.pack("<BQII", 1, 8, 0, 0)
    (path,) = _recording(folder).glob("*.mcap")
    path.write_bytes(MAGIC + header + struct.pack("<BQ", 6, len(content)) + content + MAGIC)


def database(folder: Path, chance: random.Random) -> None:
    """Has a database of SQLite whose tables are views that never end, of other types, or many rows."""
    place = _recording(folder)
    path = place / "metadata.yaml"
    data = yaml.safe_load(path.read_text())
    info = data["rosbag2_bagfile_information"]
    info["storage_identifier"], info["relative_file_paths"] = "sqlite3", [DATABASE]
    _write_metadata(path, data)
    endless = "WITH RECURSIVE r(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM r) SELECT id"
    texts = "name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT"
    topics = f"CREATE TABLE topics(id INTEGER PRIMARY KEY, {texts})"
    messages = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    database = sqlite3.connect(place / DATABASE)
    with database:
        way = chance.randrange(5)
        if way == 0:
            database.execute(topics)
            database.execute(f"CREATE VIEW messages AS {endless}, 1 AS topic_id, id AS timestamp, x'00' AS data FROM r")
        elif way == 1:
            database.execute(
                f"CREATE VIEW topics AS {endless}, 'a' AS name, 'b' AS type, 'cdr' AS serialization_format FROM r"
            )
            database.execute(messages)
        else:
            database.execute(topics)
            database.execute(messages)
            rows = [(number, 1, 0, b"") for number in range(chance.choice((1, 1000)))]
            odd = chance.choice(("\x1b[2J", None, 2.5, b"\xff", 2**62, "x" * 10_000))
            database.execute("INSERT INTO topics VALUES (1, ?, ?, 'cdr', '')", (odd, chance.choice(("a/msg/B", odd))))
            database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
            if way == 2:
                database.execute("INSERT INTO messages VALUES (1000000, 1, ?, zeroblob(500000000))", (odd,))
    database.close()


def numbers(folder: Path, chance: random.Random) -> None:
    """Has odd numbers of messages and times."""
    path = _recording(folder) / "metadata.yaml"
    data = yaml.safe_load(path.read_text())
    info = data["rosbag2_bagfile_information"]
    info[chance.choice(("message_count", "duration", "starting_time", "version", "topics_with_message_count"))] = (
        odd_value(chance)
    )
    _write_metadata(path, data)


MAKERS: dict[str, Callable[[Path, random.Random], None]] = {
    "metadata": metadata,
    "paths and storages": paths,
    "YAML": yaml_text,
    "records": records,
    "records again": records,
    "chunks": chunk,
    "databases": database,
    "numbers": numbers,
    "facts": facts,
    "special files": special_entries,
    "bytes": change_bytes,
    "bytes again": change_bytes,
}
