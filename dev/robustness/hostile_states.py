"""Hostile `.world` files: good ones that are changed in their structure or in their bytes, by a seed."""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import random
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

PLANTED = "import pathlib; pathlib.Path(__file__).with_name('canary').touch()\nclass Thing: pass\n"
"""Module that every hostile file may name."""
CLASSES = (
    *("planted:Thing", "planted:canary", "planted.inner:Thing", "antigravity:x", "this:x", "idlelib.__main__:x"),
    *("os:system", "subprocess:Popen", "builtins:eval", "pickle:loads", "pathlib:Path", "rpbi.world.world:World"),
    *("rpbi.follower:main", "rpbi.render.__main__:main", "rpbi.ros.node:SimulatorNode", "rpbi:planted"),
    *("rpbi.world.saved.state:WorldState", "rpbi.config.world:WorldConfig", "rpbi.geometry:Pose", "../planted:Thing"),
    *("", ":", "planted", "planted:Thing\n\x1b[2J", "a" * 20_000 + ":b", ".".join("a" * 3000) + ":b"),
)
"""Names of classes: planted ones, those of the standard library, and those of rpbi that do not fit."""
KINDS = (
    "input",
    "add",
    "add_camera",
    "remove",
    "dynamics",
    "physics",
    "sensor_rate",
    "attach",
    "detach",
    "halt",
    "pause",
)
ACTIONS = ("teleport", "set_joint_state", "switch_mode", "set_gains", "move", "follow", "push", "cancel", "nothing")
VALUES = (
    *(
        "null",
        "true",
        "[]",
        "{}",
        '""',
        "-1",
        "1e308",
        "NaN",
        "-Infinity",
        "9" * 4000,
        "9" * 5000,
        "[",
        '{"a":1,"b":2}',
    ),
    *("[" * 90 + "]" * 90, "[" * 5000 + "]" * 5000, '{"pairs":' * 90 + "1" + "}" * 90, '{"pairs":[[[],{}]]}'),
    *(
        '{"pairs":[[{"pairs":[]},1]]}',
        f"[{'0,' * 1_000_000}0]",
        '"' + "x" * 1_000_000 + '"',
        '{"pairs":3}',
        '"\\ud800"',
    ),
)
"""Texts of values."""
TICKS = (0, -1, 1, 19_999_999, 20_000_001, 2**31, 2**63, 10**400, True, 1.5, "5", None, [])
PATHS = (
    "{place}/pipe",
    "/dev/zero",
    "/etc/shadow",
    "/proc/self/mem",
    "{place}",
    "{place}/link",
    "../../x",
    "/" + "a" * 5000,
)
Parts = tuple[dict[str, Any], list[list[Any]]]
"""The header of a file and its commands."""


def write_hostile(seed: int, place: Path, good: Sequence[Path]) -> tuple[Path, str]:
    """Writes a hostile file into a folder, and returns its path and how it was made.

    Args:
        seed: The seed.
        place: An empty folder. It gets a module `planted`, a pipe and a link, too.
        good: Good files.
    """
    rng = random.Random(f"state {seed}")
    (place / "planted.py").write_text(PLANTED)
    os.mkfifo(place / "pipe")
    (place / "link").symlink_to("/dev/zero")
    path = place / "hostile.world"
    how = rng.choice([*STRUCTURE, *STRUCTURE, *BYTES])
    data = rng.choice(good).read_bytes()
    if how in BYTES:
        BYTES[how](rng, path, data)
        return path, how
    header, *commands = map(json.loads, gzip.decompress(data).splitlines()[:-1])
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        STRUCTURE[how](rng, header, commands)
    lines = b"".join(json.dumps(each).replace("{place}", str(place)).encode() + b"\n" for each in (header, *commands))
    path.write_bytes(gzip.compress(lines + hashlib.sha256(lines).hexdigest().encode(), 1))
    return path, how


def _other(rng: random.Random, text: str) -> str:
    """Returns a text with one number, text or class replaced."""
    found = list(re.finditer(r"-?\d+\.?\d*(e-?\d+)?|\"[^\"\\]*\"|[\w.]+:[A-Z]\w+", text))
    if not found:
        return rng.choice(VALUES)
    at = rng.choice(found)
    number = ("-1", "0", "1e308", "NaN", "1e-300", "99999999999999999999", "null", "[1]", '"x"')
    new = rng.choice(CLASSES) if ":" in at[0] else rng.choice(number if at[0][0] != '"' else ('"x"', "3", "null", "{}"))
    return text[: at.start()] + new + text[at.end() :]


def _class(rng: random.Random) -> str:
    return rng.choice(CLASSES)


def _values(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    one = rng.choice(commands)
    one[3] = rng.choice(
        (rng.choice(VALUES), json.dumps({_class(rng): rng.choice(([], {}, [1, 2], "x"))}), rng.choice(commands)[3])
    )


def _parts_of_values(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    one = rng.choice(commands)
    one[3] = _other(rng, one[3])


def _names(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    one = rng.choice(commands)
    one[rng.choice((1, 2))] = rng.choice(
        (*KINDS, *ACTIONS, rng.choice(commands)[1], "iiwa/target", "box/pose", "\x1b[2J")
    )


def _additions(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    config = {"name": "later", "sensors": [{"type": _class(rng), "name": "s", "hz": 1.0}]}
    pairs = {"pairs": [[key, value] for key, value in config.items()]}
    value = rng.choice(
        ([_class(rng), pairs], ["dynamic", pairs], ["dynamic", {_class(rng): config}], [_class(rng)] * 9)
    )
    commands.insert(0, [commands[0][0], "", "add", json.dumps(value)])


def _ticks(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    if rng.random() < 0.5:
        rng.choice(commands)[0] = rng.choice(TICKS)
    else:
        header[rng.choice(("tick", "start", "commands"))] = rng.choice(TICKS)


def _hashes(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    header["state_hash"] = rng.choice(("0" * 32, "", "\x1b[2J", "x" * 1_000_000, header["state_hash"][:-1] + "0"))


def _headers(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    key = rng.choice([*header])
    header[key] = rng.choice((None, 3, "", [], {}, "x" * 1000, header[rng.choice([*header])]))
    if rng.random() < 0.3:
        del header[key]


def _descriptions(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    try:
        described = json.loads(header["description"])
        item = rng.choice([described, *described["objects"]])
    except (TypeError, ValueError, KeyError):  # it was changed before
        return
    change = rng.randrange(6)
    if change == 0:
        item["config"] = _other(rng, item["config"])
    elif change == 1:
        item["type" if "type" in item else "config"] = rng.choice((_class(rng), json.dumps({_class(rng): {}})))
    elif change == 2:
        item["config"] = re.sub(r'"[^"]*\.(urdf|obj|stl)"', json.dumps(rng.choice(PATHS)), item["config"], flags=re.I)
    elif change == 3:
        described["files"] = {rng.choice(PATHS) + "/" * n: "0" for n in range(rng.choice((1, 5, 2000)))}
        described["start_hash"] = "0" * 32
    elif change == 4:
        described["descriptions"] = {"e": "ee" * 1000, '"': "x", **{f"/{n}": "<robot/>" for n in range(1000)}}
    else:
        described[rng.choice([*described])] = rng.choice((None, [], {}, "x", "[" * 5000, -1))
    header["description"] = json.dumps(described)
    if rng.random() < 0.2:
        header["description"] = _other(rng, header["description"])


def _keyframes(rng: random.Random, header: dict[str, Any], commands: list[list[Any]]) -> None:
    import base64
    import zlib

    text = zlib.decompress(base64.b64decode(header["keyframe"])).decode() if header["keyframe"] else '{"format":1}'
    for _ in range(rng.choice((1, 3, 10))):
        text = _other(rng, text)
    text = rng.choice((text, text, text, "[" * 100_000, "[]," * 20_000_000, " " * (1 << 27)))
    header["keyframe"] = base64.b64encode(zlib.compress(text.encode(), 1)).decode()


STRUCTURE: dict[str, Callable[[random.Random, dict[str, Any], list[list[Any]]], None]] = {
    "values": _values,
    "parts of values": _parts_of_values,
    "names": _names,
    "additions": _additions,
    "ticks": _ticks,
    "hashes": _hashes,
    "headers": _headers,
    "descriptions": _descriptions,
    "descriptions again": _descriptions,
    "keyframes": _keyframes,
}
"""Changes of the structure, by name; the seal at the end is right."""


def _forged(rng: random.Random, path: Path, data: bytes) -> None:
    lines = gzip.decompress(data)
    old = rng.choice((b'"tick": ', b'"state_hash": "', b'"commands": ', b"\n["))
    path.write_bytes(gzip.compress(lines.replace(old, old + rng.choice((b"1", b"0", b"9999")), 1)))


def _spoilt(rng: random.Random, path: Path, data: bytes) -> None:
    packed = rng.random() < 0.5
    spoilt = bytearray(data if packed else gzip.decompress(data))
    for _ in range(rng.choice((1, 3, 30))):
        spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
    del spoilt[rng.choice((len(spoilt), rng.randrange(len(spoilt)))) :]
    path.write_bytes(spoilt if packed else gzip.compress(spoilt, 1))


def _bomb(rng: random.Random, path: Path, data: bytes) -> None:
    unit = rng.choice((b"\0", b"[", b"[],", b'{"format": 2}\n', b'[0,"","",""]\n', b" ", b"\n", b'"'))
    head = rng.choice(
        (b"", gzip.decompress(data).split(b"\n")[0].replace(b'"commands": ', b'"commands": 199999') + b"\n")
    )
    with gzip.open(path, "wb", 1) as file:
        file.write(head)
        for _ in range(rng.choice((1, 30, 300))):
            file.write(unit * (1_000_000 // len(unit)))


def _special(rng: random.Random, path: Path, data: bytes) -> None:
    kind = rng.randrange(6)
    if kind == 0:
        os.mkfifo(path)
    elif kind == 1:
        path.symlink_to(rng.choice(("/dev/zero", "/etc/shadow", "/proc/self/mem", str(path))))
    elif kind == 2:
        path.mkdir()
    elif kind == 3:
        path.write_bytes(rng.choice((b"", b"<sdf/>", b"\x1f\x8b", b"x\x9c", rng.randbytes(5000))))
    elif kind == 4:
        os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 1 << 40)
    else:
        path.write_bytes(data * rng.choice((2, 100)))


BYTES: dict[str, Callable[[random.Random, Path, bytes], None]] = {
    "forged without a seal": _forged,
    "bytes": _spoilt,
    "bombs": _bomb,
    "no ordinary files": _special,
}
"""Changes of the bytes, by name."""
