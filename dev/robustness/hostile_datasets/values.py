"""Values and texts that readers do not expect, and changes that any folder of files can have."""

from __future__ import annotations

import json
import os
import random
import socket
from pathlib import Path
from typing import Any

CANARY = "canary"
"""Name of the file that code in a data set makes, next to its folder."""
DEEP = 5000
LONG = 200_000


def odd_value(chance: random.Random) -> Any:
    """Returns a value of JSON that a reader does not expect."""
    deep: Any = 0
    for _ in range(chance.choice((50, DEEP))):
        deep = [deep]
    texts = (
        "",
        "x" * LONG,
        "\x1b]0;owned\x07\x1b[2J",
        "../../canary",
        "/etc/passwd",
        "canary_module:Canary",
        "\u202e",
        "{0}",
    )
    numbers = (0, -1, 2**31, 2**63, -(2**63), 10**400, 1e308, float("nan"), float("inf"), True, None)
    others = ([], {}, [None] * 10_000, deep, {"a": {"b": []}}, [[0.0] * 1000] * 100)
    return chance.choice((*texts, *numbers, *others))


def spoil(data: Any, chance: random.Random) -> Any:
    """Returns JSON with a value, at a random place, that a reader does not expect; a key may be lost or new."""
    if isinstance(data, dict) and data and chance.random() < 0.9:
        key = chance.choice(list(data))
        way = chance.random()
        if way < 0.1:
            del data[key]
        elif way < 0.2:
            data[chance.choice(("", "x" * LONG, "\x1b[2J", "../../canary", "0"))] = data[key]
        else:
            data[key] = spoil(data[key], chance)
        return data
    if isinstance(data, list) and data and chance.random() < 0.9:
        index = chance.randrange(len(data))
        data[index] = spoil(data[index], chance)
        return data
    return odd_value(chance)


def write_json(path: Path, data: Any) -> None:
    """Writes JSON of any depth."""
    try:
        path.write_text(json.dumps(data))
    except RecursionError:
        path.write_text("[" * DEEP + "]" * DEEP)


def spoil_json(path: Path, chance: random.Random) -> None:
    """Changes one to three values of a JSON file."""
    data = json.loads(path.read_text())
    for _ in range(chance.randint(1, 3)):
        data = spoil(data, chance)
    write_json(path, data)


def some_file(folder: Path, chance: random.Random) -> Path:
    return chance.choice(sorted(each for each in folder.rglob("*") if each.is_file()))


def change_bytes(folder: Path, chance: random.Random) -> None:
    """Changes, removes, repeats or adds bytes of a file."""
    path = some_file(folder, chance)
    data = bytearray(path.read_bytes())
    for _ in range(chance.choice((1, 3, 30))):
        at = chance.randrange(len(data) + 1)
        way = chance.randrange(5)
        if way == 0:
            data[at : at + 1] = bytes([chance.randrange(256)])
        elif way == 1:
            data[at : at + 8] = chance.choice((b"\xff" * 8, b"\0" * 8, b"\xff" * 4 + b"\x7f\0\0\0"))
        elif way == 2:
            del data[at : at + chance.choice((1, 4, 1000))]
        elif way == 3:
            data[at:at] = data[at : at + chance.choice((1, 8, 4000))]
        else:
            data[at:at] = bytes(chance.randrange(256) for _ in range(chance.choice((1, 8, 64))))
    path.write_bytes(data[: chance.randrange(len(data) + 1)] if chance.random() < 0.1 else data)


def special_entries(folder: Path, chance: random.Random) -> None:
    """Has a link, a pipe, a socket or many folders in place of a file, or next to it."""
    path = some_file(folder, chance)
    if chance.random() < 0.7:
        path.unlink()
    else:
        path = path.with_name("other" + path.suffix)
    way = chance.randrange(6)
    if way == 0:
        os.mkfifo(path)
    elif way == 1:
        path.symlink_to(chance.choice(("/etc/passwd", "/dev/zero", "..", str(folder), "nowhere")))
    elif way == 2:
        with socket.socket(socket.AF_UNIX) as listener:
            here = os.getcwd()
            os.chdir(path.parent)
            try:
                listener.bind(path.name)
            finally:
                os.chdir(here)
    elif way == 3:
        path.mkdir()
    elif way == 4:
        for _ in range(40):
            path.mkdir()
            path = path / "a"
    else:
        path.with_name("\x1b[2J\n" + path.name).write_bytes(b"")


def facts(folder: Path, chance: random.Random) -> None:
    """Changes the facts in `rpbi/`."""
    spoil_json(chance.choice(sorted((folder / "rpbi").glob("*.json"))), chance)
