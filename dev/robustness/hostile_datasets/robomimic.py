"""Hostile data sets of robomimic."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .values import CANARY, change_bytes, facts, odd_value, special_entries, spoil

FILE = "dataset.hdf5"
OBSERVATIONS = "data/demo_0/obs"


def _edit(change: Callable[[h5py.File, random.Random], object]) -> Callable[[Path, random.Random], None]:
    def make(folder: Path, chance: random.Random) -> None:
        with h5py.File(folder / FILE, "r+") as file:
            change(file, chance)

    return make


def _places(file: h5py.File) -> list[str]:
    found: list[str] = []
    file.visit(found.append)
    return found


def links(file: h5py.File, chance: random.Random) -> None:
    """Has links to other files, to nothing, and around a circle."""
    place = chance.choice(_places(file))
    del file[place]
    file[place] = chance.choice(
        (
            h5py.ExternalLink("/etc/passwd", "/"),
            h5py.ExternalLink("../" + CANARY, "/data"),
            h5py.ExternalLink(FILE, "/data"),
            h5py.SoftLink("/nowhere"),
            h5py.SoftLink(f"/{place}"),
            h5py.SoftLink("/"),
            file["/"],
        )
    )


def elsewhere(file: h5py.File, chance: random.Random) -> None:
    """Has values in other files."""
    name = chance.choice(("state", "velocity", "pose_box", "images_camera_colour"))
    del file[f"{OBSERVATIONS}/{name}"]
    if chance.random() < 0.5:
        external = [(chance.choice(("/etc/passwd", "/dev/zero", "../" + CANARY)), 0, 800)]
        file.create_dataset(f"{OBSERVATIONS}/{name}", (10, 10), "f8", external=external)
    else:
        layout = h5py.VirtualLayout(shape=(10, 10), dtype="f8")
        layout[:] = h5py.VirtualSource(chance.choice(("/etc/passwd", ".", "../x.hdf5")), "data", shape=(10, 10))
        file.create_virtual_dataset(f"{OBSERVATIONS}/{name}", layout)


def unfolding(file: h5py.File, chance: random.Random) -> None:
    """Has very many values that need no memory."""
    place = chance.choice(("data/demo_0/actions", f"{OBSERVATIONS}/state", f"{OBSERVATIONS}/images_camera_colour"))
    del file[place]
    shape = chance.choice(
        ((10**9, 7), (10**6, 10**6), (20, 10**5, 10**5, 3), (10**8, 3), (60_000_000,), (10**7, 84, 84, 3))
    )
    kind = chance.choice(("f4", "u1", "S1000", "f8"))
    file.create_dataset(place, shape, kind, chunks=True, compression=chance.choice((None, "gzip")), fillvalue=None)


def types(file: h5py.File, chance: random.Random) -> None:
    """Has other types of values."""
    place = chance.choice([each for each in _places(file) if isinstance(file[each], h5py.Dataset)])
    count = len(file[place])
    del file[place]
    kinds: tuple[Any, ...] = (
        h5py.vlen_dtype(np.float64),
        h5py.string_dtype(),
        np.dtype([("a", "f8"), ("b", "i4")]),
        h5py.ref_dtype,
        "f2",
        np.dtype("V100"),
        h5py.enum_dtype({"a": 1}),
        "c16",
        "S3",
        np.dtype(("f4", (3, 3))),
        "u8",
        "i1",
        h5py.regionref_dtype,
    )
    shape = chance.choice(((count,), (count, 3), (), (0,), (count, 0), (count, 2, 2), (count + 1, 3)))
    file.create_dataset(place, shape, chance.choice(kinds))


def attributes(file: h5py.File, chance: random.Random) -> None:
    """Changes attributes, those of JSON too."""
    place = chance.choice(["data", "data", "data/demo_0", "action_scaling"])
    attrs = file[place].attrs
    if not list(attrs):
        return
    key = chance.choice(list(attrs))
    if isinstance(attrs[key], str) and chance.random() < 0.7:
        try:
            attrs[key] = json.dumps(spoil(json.loads(attrs[key]), chance))[:60_000]
        except (ValueError, RecursionError):
            attrs[key] = "[" * 50_000
        return
    attrs[key] = chance.choice(
        (np.arange(1000), "\x1b[2J", b"\xff\xfe", 2**63, -1, np.nan, h5py.Empty("f8"), [b"a", b"b"])
    )


def members(file: h5py.File, chance: random.Random) -> None:
    """Gives groups odd names, many members, or many levels."""
    way = chance.randrange(4)
    group = file[chance.choice(("data", "data/demo_0", OBSERVATIONS, "mask"))] if "mask" in file else file["data"]
    if way == 0:
        for number in range(chance.choice((100, 3_000))):
            group.create_group(f"demo_{number + 5}")
    elif way == 1:
        for _ in range(300):
            group = group.create_group("level")
    elif way == 2:
        for text in ("\x1b]0;owned\x07", "demo_\u202e", "demo_999999999999999999999", "demo_-1", "demo_", "x" * 60_000):
            group.require_group(text)
    else:
        del file[chance.choice(_places(file))]


def numbers(file: h5py.File, chance: random.Random) -> None:
    """Has odd numbers."""
    place = chance.choice([each for each in _places(file) if isinstance(file[each], h5py.Dataset)])
    each = file[place]
    if each.dtype.kind == "f":
        each[...] = chance.choice((np.nan, np.inf, 1e38, 0.0))
    elif each.dtype.kind == "i":
        each[...] = chance.choice((-1, 2**31, 2**62))


def scaling(file: h5py.File, chance: random.Random) -> None:
    """Has other numbers and shapes of the scaling."""
    for name in ("low", "high"):
        if chance.random() < 0.6:
            del file[f"action_scaling/{name}"]
            value = odd_value(chance)
            is_number = isinstance(value, (int, float)) and abs(value) < 2**62
            file[f"action_scaling/{name}"] = [value] * chance.choice((0, 1, 3, 1000)) if is_number else "text"


MAKERS: dict[str, Callable[[Path, random.Random], None]] = {
    "links": _edit(links),
    "values elsewhere": _edit(elsewhere),
    "unfolding values": _edit(unfolding),
    "types": _edit(types),
    "attributes": _edit(attributes),
    "members": _edit(members),
    "numbers": _edit(numbers),
    "scaling": _edit(scaling),
    "facts": facts,
    "special files": special_entries,
    "bytes": change_bytes,
    "bytes again": change_bytes,
}
