"""Hostile data sets of LeRobot."""

from __future__ import annotations

import io
import json
import pickle
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from .values import CANARY, change_bytes, facts, odd_value, special_entries, spoil_json, write_json

DATA, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
TEMPLATES = (
    "{chunk_index.__class__.__init__.__globals__}",
    "{chunk_index:999999999d}",
    "{chunk_index!r:>99999999}",
    "../../" + CANARY,
    "/etc/passwd",
    "{file_index[0]}",
    "{",
    "{}",
    "{0}",
    "data/../../{file_index}",
    "data/\x1b[2J{file_index}",
    "x" * 5000,
    "{chunk_index:{file_index}}",
    "/dev/zero",
    "data/{unknown}",
    "",
    ".",
    "{video_key.__class__}",
)


class Code:
    """Is unpickled by making the canary."""

    def __init__(self, folder: Path) -> None:
        self._path = folder.parent / CANARY

    def __reduce__(self) -> Any:
        return Path.touch, (self._path,)


def info(folder: Path, chance: random.Random) -> None:
    spoil_json(folder / "meta/info.json", chance)


def stats(folder: Path, chance: random.Random) -> None:
    spoil_json(folder / "meta/stats.json", chance)


def template(folder: Path, chance: random.Random) -> None:
    path = folder / "meta/info.json"
    data = json.loads(path.read_text())
    data[chance.choice(("data_path", "video_path"))] = chance.choice(TEMPLATES)
    write_json(path, data)


def unfolding(folder: Path, chance: random.Random) -> None:
    """Writes a small file with very many equal rows."""
    name = chance.choice((DATA, EPISODES, "meta/tasks.parquet"))
    table = parquet.read_table(folder / name).slice(0, 1)
    rows = table.take(pa.array(np.zeros(4_000_000 // table.num_columns**2, int)))
    with parquet.ParquetWriter(folder / name, rows.schema, compression="zstd") as writer:
        for _ in range(chance.choice((1, 30, 100))):
            writer.write_table(rows)


def columns(folder: Path, chance: random.Random) -> None:
    """Gives columns of a table other types, values or names."""
    name = chance.choice((DATA, EPISODES, "meta/tasks.parquet"))
    table = parquet.read_table(folder / name)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(table.num_columns)
        key, count = table.column_names[at], len(table)
        odd = (
            pa.nulls(count),
            pa.array(["\x1b[2J"] * count),
            pa.array([b"\0" * 9] * count),
            pa.array([-(2**62)] * count),
            pa.array([float("nan")] * count),
            pa.array([[0.0] * (i % 5) for i in range(count)]),
            pa.array([{"a": 1}] * count),
            pa.array([[["x"]]] * count),
            pa.array([2**63 - 1] * count),
            pa.array([True] * count),
            pa.array([1e300] * count),
            pa.array([["x" * 1000]] * count),
            pa.array([None if i % 2 else i for i in range(count)], pa.int64()),
        )
        new = chance.choice((key, key, key, "\x1b[2J", "x" * 60_000, "", table.column_names[0]))
        table = table.set_column(at, new, chance.choice(odd))
    parquet.write_table(table, folder / name)


def extension(folder: Path, chance: random.Random) -> None:
    """Names a type of Python in the schema, which old readers unpickle."""
    name = chance.choice((DATA, EPISODES, "meta/tasks.parquet"))
    table = parquet.read_table(folder / name)
    metadata = {
        b"ARROW:extension:name": chance.choice((b"arrow.py_extension_type", b"canary_module.Canary")),
        b"ARROW:extension:metadata": pickle.dumps(Code(folder)),
    }
    field = table.schema.field(0).with_metadata(metadata)
    parquet.write_table(table.cast(table.schema.set(0, field)), folder / name)


def video(folder: Path, chance: random.Random) -> None:
    """Has a list of other files, or another container, in place of a video, or changes its boxes."""
    path = chance.choice(sorted(folder.glob("videos/*/*/*.mp4")))
    lists = (
        b"#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n",
        b"ffconcat version 1.0\nfile '/etc/passwd'\n",
        b"#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/x\n",
        b"RIFF\xff\xff\xff\xffAVI LIST",
        b"",
    )
    if chance.random() < 0.4:
        path.write_bytes(chance.choice(lists))
        return
    data = bytearray(path.read_bytes())
    for _ in range(chance.randint(1, 4)):
        box = chance.choice((b"avc1", b"tkhd", b"stts", b"stsz", b"stco", b"mdhd", b"moov", b"dref", b"ctts", b"avcC"))
        at = data.find(box)
        if at >= 4:
            at += chance.choice((-4, 4, 8, 12, 16, 28, 30, 32))
            data[at : at + 4] = chance.choice(
                (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", b"\x3f\xff\x3f\xff")
            )
    path.write_bytes(data)


def images(folder: Path, chance: random.Random) -> None:
    """Has code, or arrays of very many values, in the coarse images."""
    path = chance.choice(sorted((folder / "rpbi").glob("*.npz")))
    key = "observation.images.camera_colour"
    way = chance.randrange(3)
    if way == 0:
        np.savez(path, **{key: np.array([Code(folder)], object)})
        return
    shape = (chance.choice((10**12, 10**8, -1)), 8, 8)
    header = str({"descr": "<f2", "fortran_order": False, "shape": shape})
    header = header if way == 1 else chance.choice(("[" * 3000, "__import__('os')", "{'descr': ['a'] * 9 ** 9}"))
    body = header.ljust(117) + "\n"
    data = io.BytesIO(b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body.encode() + bytes(1_000_000))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(f"{key}.npy", data.getvalue())


def names(folder: Path, chance: random.Random) -> None:
    """Gives features odd names, shapes and types."""
    path = folder / "meta/info.json"
    data = json.loads(path.read_text())
    for feature in data["features"].values():
        if chance.random() < 0.3:
            feature[chance.choice(("names", "shape", "dtype"))] = odd_value(chance)
    write_json(path, data)


MAKERS: dict[str, Callable[[Path, random.Random], None]] = {
    "info": info,
    "templates": template,
    "unfolding tables": unfolding,
    "columns": columns,
    "extension types": extension,
    "videos": video,
    "images with code": images,
    "features": names,
    "statistics": stats,
    "facts": facts,
    "special files": special_entries,
    "bytes": change_bytes,
    "bytes again": change_bytes,
}
