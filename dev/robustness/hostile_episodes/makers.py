"""The kinds of hostile folders of episodes, and one for each seed."""

from __future__ import annotations

import bz2
import contextlib
import hashlib
import json
import os
import random
import shutil
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from robustness.hostile_bags.records import text
from robustness.hostile_bags.sessions import DATA, NUMBERS_OF_WORLDS, PHYSICS, rewrite, serialised
from ros_pybullet_interface.msg import SimulationState, WorldCommand, WorldCommands
from rpbi_data.episodes.folder import BAG, EARLIER, FACTS, EpisodeFolder

FIRST, PART = "episode_000000", ".episode_000001.part"
HASH = "0" * 64
ODD: tuple[Any, ...] = (
    *(None, True, -1, 0, 10**400, 2**63, 1e308, float("nan"), float("inf"), "", "x", [], {}, [[]], {"a": {"b": []}}),
    *("x" * 100_000, "\x1b]0;x\x07\x1b[2J", "\u202egnp.exe", "a\nb\r\tc", "<script>x()</script>", "%n%s", "{x}", "\0"),
)
"""Values in the place of others."""
PLACES = (
    *(
        FIRST,
        f"{FIRST}/{FACTS}",
        f"{FIRST}/{BAG}",
        f"{FIRST}/{EARLIER}",
        f"{FIRST}/.{FACTS}.part",
        "files",
        "discarded",
    ),
    *(PART, f"{PART}/{FACTS}", f"{PART}/{BAG}", f"{PART}/{BAG}.active", f"{PART}/.{FACTS}.part", "farm.yaml"),
)
"""Entries of a folder that a reader may open or write."""


class Place(NamedTuple):
    """Tools of a maker.

    Attributes:
        rng: Source of all that is random.
        demos: The folder of episodes, a good one that the maker spoils.
        outside: A folder outside of it, which must stay as it is.
    """

    rng: random.Random
    demos: Path
    outside: Path

    @property
    def episode(self) -> Path:
        return self.demos / FIRST

    def facts(self, change: Callable[[dict[str, Any]], None], folder: str = FIRST) -> None:
        """Changes a description."""
        path = self.demos / folder / FACTS
        facts = yaml.safe_load(path.read_text())
        change(facts)
        path.write_text(yaml.safe_dump(facts))

    def names(self) -> tuple[str, ...]:
        """Returns names of files that lead to the outside, or nowhere."""
        deep = "/.." * 20
        of_outside = str(self.outside / "secret.obj")
        return (
            *(f"{deep}{self.outside}/new.obj", f"..{deep}{of_outside}", f"/a/b{deep}{of_outside}", of_outside),
            *("../../outside/new.obj", "/../../../../new", "//..//..//new", ".", "/", "", "/x" * 600, "/a\0b", "/a\nb"),
            *(
                "/proc/self/mem",
                "/dev/zero",
                "~/x",
                "file:///etc/passwd",
                "/etc/shadow",
                "/\x1b[2J",
                '/a"/><x',
                "C:\\x",
            ),
        )


def _paths(place: Place) -> None:
    def change(facts: dict[str, Any]) -> None:
        for each in place.rng.sample(facts["files"], place.rng.randint(1, 3)):
            each["path"] = place.rng.choice(place.names())

    place.facts(change)


def _hashes(place: Place) -> None:
    odd = (*place.names(), HASH, HASH[1:], "A" * 64, f"../{HASH[3:]}", f"{HASH}\n", *ODD)

    def change(facts: dict[str, Any]) -> None:
        for each in place.rng.sample(facts["files"], place.rng.randint(1, 3)):
            each["sha256"] = place.rng.choice((*odd, facts["files"][0]["sha256"]))

    place.facts(change)


def _meshes(place: Place) -> None:
    def change(facts: dict[str, Any]) -> None:
        urdf = next(each for each in facts["files"] if each["path"].endswith("arm.urdf"))
        names = [*urdf["meshes"], *place.names()]
        urdf["meshes"] = {
            place.rng.choice(names): place.rng.choice((*place.names(), *ODD[:5]))
            for _ in range(place.rng.randint(1, 3))
        }
        if place.rng.randrange(4) == 0:
            urdf["meshes"] = {f"m{number}": f"/m{number}" for number in range(5000)}

    place.facts(change)


def _where(place: Place) -> Path:
    """Returns an emptied place of the folder, or a stored file."""
    stored = [f"files/{each.name}" for each in sorted((place.demos / "files").iterdir())]
    path = place.demos / place.rng.choice((*PLACES, *stored))
    path.parent.mkdir(exist_ok=True)
    if path.is_dir():
        kept = place.outside / f"kept{path.name}"
        shutil.copytree(path, kept, symlinks=True)
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    return path


def _links(place: Place) -> None:
    path = _where(place)
    kept = place.outside / f"kept{path.name}"
    secrets = [place.outside / name for name in ("secret.obj", "episode.yaml", "episode.bag", "missing", ".")]
    path.symlink_to(place.rng.choice([kept, *secrets] if kept.exists() else [*secrets, path]))


def _special_files(place: Place) -> None:
    path = _where(place)
    kind = place.rng.choice(("fifo", "fifo", "socket", "device", "folder"))
    if kind == "folder":
        path.mkdir()
    elif kind == "socket":
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX) as one:  # a long path
            one.bind(os.path.relpath(path))
    elif kind == "device":
        with contextlib.suppress(PermissionError):
            os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 5))
    if not path.exists():
        os.mkfifo(path)


def _hard_links(place: Place) -> None:
    name = place.rng.choice((f"{PART}/{BAG}.active", f"{PART}/{BAG}", f"{PART}/{FACTS}", f"{FIRST}/{FACTS}"))
    path = place.demos / name
    path.unlink(missing_ok=True)
    os.link(place.outside / ("broken.bag" if BAG in name else "episode.yaml"), path)


def _types(place: Place) -> None:
    def change(facts: dict[str, Any]) -> None:
        holders: list[Any] = [
            facts,
            facts,
            facts["topics"],
            *facts["topics"].values(),
            facts["versions"],
            *facts["files"],
        ]
        for _ in range(place.rng.randint(1, 3)):
            holder = place.rng.choice(holders)
            key = place.rng.choice([*holder, "odd"])
            holder[key] = place.rng.choice(ODD)

    place.facts(change, place.rng.choice((FIRST, FIRST, FIRST, PART)))


def _numbers(place: Place) -> None:
    odd = (float("nan"), float("inf"), -1, 10**400, 10**15, 1e308, True, "1", -0.0, 5e-324)

    def change(facts: dict[str, Any]) -> None:
        for each in place.rng.sample(list(facts["topics"].values()), 2):
            each[place.rng.choice(("messages", "rate_hz", "max_gap_s", "set_back_s"))] = place.rng.choice(odd)
        facts[place.rng.choice(("number", "seconds", "odd"))] = place.rng.choice(odd)
        facts["published"] = {place.rng.choice(list(facts["topics"])): place.rng.choice(odd)}

    place.facts(change)


def _yaml(place: Place) -> None:
    bomb = "a: &a0 [x, x]\n" + "\n".join(f"b{i}: &a{i + 1} [*a{i}, *a{i}, *a{i}, *a{i}]" for i in range(30))
    odd = (
        *(
            "[" * 50_000,
            "{" * 50_000,
            "- " * 20_000,
            bomb,
            "number: &a [*a]",
            "number: 0\nnumber: 1",
            "",
            "\0",
            "---\n---\n",
        ),
        *(
            "number: !!python/object/apply:os.system [touch canary]",
            "!!set [a]",
            "number: !!binary x",
            "a: *b",
            "? [1]",
        ),
        *(
            "number: 0\nnote: " + "x" * 3_000_000,
            "number: 0\n<<: {label: x}",
            "number: 0\nlabel: !!timestamp 2026-99-99",
        ),
        *(
            "number: 0\ntopics: {" + ", ".join(f"/t{n}: {{}}" for n in range(20_000)) + "}",
            "9" * 5000,
            "number: 0x" + "f" * 900,
        ),
    )
    path = place.demos / place.rng.choice((FIRST, FIRST, PART)) / FACTS
    path.write_bytes(place.rng.choice((*(each.encode() for each in odd), b"\xff\xfe\x00", b"label: \x80")))


def _texts(place: Place) -> None:
    def change(facts: dict[str, Any]) -> None:
        for key in place.rng.sample(("label", "note", "started", "namespace", "seeds", "git"), 3):
            facts[key] = place.rng.choice([each for each in ODD if isinstance(each, str)])
        facts["topics"][place.rng.choice(ODD[-8:])] = {
            "type": "\x1b[31m",
            "messages": 1,
            "rate_hz": 1.0,
            "max_gap_s": 1.0,
        }
        facts["versions"]["\x1b[2J"] = "\x07"

    place.facts(change)


def _folders(place: Place) -> None:
    names = (
        "episode_0000002",
        "episode_٠٠٠٠٠٢",
        "episode_" + "9" * 12,
        "episode_" + "9" * 200,
        "episode_000002\n",
        "e\x1b[2J",
    )
    for name in (*names, ".episode_999999.part", "discarded/episode_000000", "discarded/episode_" + "9" * 30):
        (place.demos / name).mkdir(parents=True)
        if place.rng.randrange(2):
            shutil.copy(place.episode / FACTS, place.demos / name / FACTS)
    for number in range(place.rng.choice((0, 300))):
        EpisodeFolder(place.demos).folder_of(10 + number).mkdir()


def _spoilt(rng: random.Random, data: bytes) -> bytes:
    spoilt = bytearray(data)
    for _ in range(rng.choice((1, 5, 50))):
        spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
    return bytes(spoilt[: rng.choice((len(spoilt), rng.randrange(len(spoilt)))) if rng.randrange(3) == 0 else None])


def _bytes_of_facts(place: Place) -> None:
    path = place.episode / FACTS
    path.write_bytes(_spoilt(place.rng, path.read_bytes()))


def _bytes_of_bags(place: Place) -> None:
    path = place.demos / place.rng.choice((f"{FIRST}/{BAG}", f"{PART}/{BAG}.active"))
    path.write_bytes(_spoilt(place.rng, path.read_bytes()))
    if place.rng.randrange(4) == 0:
        shutil.copy(path, place.episode / EARLIER)


def _descriptions(place: Place) -> None:
    """The description of the world names other files, types or values."""
    facts = yaml.safe_load((place.episode / FACTS).read_text())
    urdf = next(each["path"] for each in facts["files"] if each["path"].endswith("arm.urdf"))
    changes = (
        *NUMBERS_OF_WORLDS,
        *(
            ("rpbi.bodies.dynamic:DynamicObjectConfig", f"{name}:x")
            for name in ("canary_module", "antigravity", "this")
        ),
        *(('"type": "dynamic"', f'"type": "{name}:x"') for name in ("canary_module", "antigravity", "os")),
        *((urdf, json.dumps(name)[1:-1]) for name in place.names()),
        *(('"files": {', f'"files": {{{json.dumps(name)}: "{HASH}", ') for name in place.names()),
        *(('"descriptions": {', f'"descriptions": {{{json.dumps(name)}: "<robot/>"') for name in place.names()),
        *(("files", "file"), ('"config"', '"conf"'), ('"objects": [', '"objects": [{}, '), ('"format"', '"\\ud800"')),
    )
    old, new = place.rng.choice(changes)

    def change(topic: str, raw: bytes) -> list[bytes]:
        return [text(raw[4:].decode().replace(old, new))] if topic.endswith("world_description") else [raw]

    rewrite(place.episode / BAG, change)


def _commands(place: Place) -> None:
    kinds = ("add", "add", "input", "remove", "dynamics", "attach", "physics", "teleport", "move", "canary_module:X")
    types = ('["canary_module:X",{"name":"x"}]', '{"canary_module:X":[1]}', '{"antigravity:X":{}}', '["dynamic",{}]')

    def change(topic: str, raw: bytes) -> list[bytes]:
        rng = place.rng
        if topic == "/rpbi/commands":
            physics = json.dumps({"pairs": [[rng.choice(PHYSICS), rng.choice((0, -1, 1e308, 2**31 - 1, 2**70, "x"))]]})
            rows = [
                WorldCommand(
                    rng.choice((0, 3, 2**32)), rng.choice(("arm", "", "\x1b[2J", "x" * 300)), rng.choice(kinds), each
                )
                for each in (*rng.choices((*DATA, *types), k=4), physics)
            ]
            return [serialised(WorldCommands(commands=rows, first=rng.choice((0, 0, 2**31))))]
        if topic == "/rpbi/state" and rng.randrange(4) == 0:
            state = SimulationState().deserialize(raw)
            state.tick, state.resets = rng.choice((state.tick, 2**63, 2**40)), rng.choice((0, 0, 2**31))
            state.state_hash = rng.choice((state.state_hash, "x", "\x1b[2J" * 1000))
            return [serialised(state)]
        return [raw]

    rewrite(place.episode / BAG, change)


def _stored(place: Place, suffix: str, content: bytes) -> None:
    """Replaces the copy of a file, with its hash in the description."""
    digest = hashlib.sha256(content).hexdigest()
    (place.demos / f"files/{digest}{suffix}").write_bytes(content)

    def change(facts: dict[str, Any]) -> None:
        next(each for each in facts["files"] if each["path"].endswith(suffix))["sha256"] = digest

    place.facts(change)


def _urdfs(place: Place) -> None:
    """The URDF matches its hash, and names files outside."""
    [copy] = (place.demos / "files").glob("*.urdf")
    urdf, rng = copy.read_text(), place.rng
    entity = f'<!DOCTYPE r [<!ENTITY x SYSTEM "file://{place.outside}/secret.obj">]>'
    bomb = '<!DOCTYPE r [<!ENTITY a0 "ha">' + "".join(f'<!ENTITY a{i + 1} "&a{i};&a{i};">' for i in range(40)) + "]>"
    spoilt = (
        *(urdf.replace("meshes/part.obj", name.replace('"', "&quot;")) for name in place.names()),
        *(
            entity + urdf.replace("arm", "&x;", 1),
            bomb + urdf.replace("arm", "&a40;", 1),
            "<a>" * 50_000,
            "%n%s" * 1000,
        ),
        *(urdf.replace('name="arm"', f'name="{each}"') for each in ("%n", "x" * 5000, "&#27;[2J")),
        *(
            urdf.replace("</robot>", "<link name='l'/>" * 30_000 + "</robot>"),
            urdf.replace('value="1"', 'value="1e308"'),
        ),
    )
    _stored(place, ".urdf", rng.choice(spoilt).encode("utf-8", "replace"))


def _mesh_files(place: Place) -> None:
    mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    spoilt = (
        *(f"mtllib {name}\n{mesh}" for name in place.names()),
        *(f"newmtl a\nmap_Kd {name}\n" for name in place.names()),
        *(
            mesh.replace("f 1 2 3", "f 1 2 99999999"),
            mesh.replace("v 1", "v nan"),
            mesh * 20_000,
            "v " * 100_000,
            "\0" * 1000,
        ),
    )
    _stored(place, ".obj", place.rng.choice(spoilt).encode("utf-8", "replace"))


def _parts(place: Place) -> None:
    """Bags of killed recorders: truncated, of zeros, or of blocks that expand to gigabytes."""
    active = place.demos / PART / f"{BAG}.active"
    content = active.read_bytes()
    rng = place.rng
    kind = rng.choice(("cut", "zeros", "bomb", "sizes", "empty"))
    if kind == "cut":
        active.write_bytes(content[: rng.randrange(len(content))])
    elif kind == "zeros":
        active.write_bytes(content[:5000] + bytes(100_000))
    elif kind == "bomb":
        folded = bz2.compress(bytes(400_000_000))
        head = b"".join(
            len(each).to_bytes(4, "little") + each
            for each in (b"op=\x05", b"compression=bz2", b"size=" + (400_000_000).to_bytes(4, "little"))
        )
        chunk = len(head).to_bytes(4, "little") + head + len(folded).to_bytes(4, "little") + folded
        active.write_bytes(content[:4117] + chunk)
    elif kind == "sizes":
        active.write_bytes(content[:4117] + b"\xff\xff\xff\x7f" * 100)
    else:
        active.write_bytes(b"")


def _long_lives(place: Place) -> None:
    """States that are years from the start, or of thousands of resets."""
    tick, resets = place.rng.choice(((2**62, 0), (10**9, 0), (10**8, 3), (2**40, 2**31)))

    def change(topic: str, raw: bytes) -> list[bytes]:
        if topic != "/rpbi/state":
            return [raw]
        state = SimulationState().deserialize(raw)
        return [
            raw,
            *([] if state.tick < 50 else [serialised(SimulationState(tick=tick, resets=resets, state_hash="f"))]),
        ]

    rewrite(place.episode / BAG, change)


def _other_files(place: Place) -> None:
    name = place.rng.choice(("farm.yaml", "farm.log", ".lock", "files/README", f"{FIRST}/more/deep"))
    (place.demos / name).parent.mkdir(exist_ok=True)
    content = place.rng.choice((b"", b"[", b"world: !!python/name:os.system x", bytes(2_000_000)))
    (place.demos / name).write_bytes(content)
    _numbers(place)


MAKERS: dict[str, Callable[[Place], None]] = {
    "paths": _paths,
    "hashes": _hashes,
    "meshes": _meshes,
    "links": _links,
    "special files": _special_files,
    "hard links": _hard_links,
    "types": _types,
    "numbers": _numbers,
    "YAML": _yaml,
    "texts": _texts,
    "folders": _folders,
    "bytes of facts": _bytes_of_facts,
    "bytes of bags": _bytes_of_bags,
    "descriptions": _descriptions,
    "commands": _commands,
    "URDFs": _urdfs,
    "mesh files": _mesh_files,
    "parts": _parts,
    "long lives": _long_lives,
    "other files": _other_files,
}
"""Changes of a good folder by name."""


WITH_PART = ("links", "special files", "hard links", "types", "YAML", "bytes of bags", "parts")
"""Kinds that change the episode of a killed recorder, too; repairs take most of the time, so others have none."""


class Hostile(NamedTuple):
    """A hostile folder.

    Attributes:
        seed: By which it was made.
        how: What was done.
        demos: The folder of episodes.
        outside: The folder next to it, which must stay unchanged.
    """

    seed: int
    how: str
    demos: Path
    outside: Path


def hostile_folders(seeds: range, good: Path, folder: Path) -> Iterator[Hostile]:
    """Yields a hostile folder for each seed; all kinds come equally often."""
    for seed in seeds:
        place = folder / f"folder{seed}"
        demos, outside = place / "inside/demos", place / "outside"
        shutil.copytree(good / "demos", demos)
        outside.mkdir()
        (outside / "secret.obj").write_text("a secret")
        (outside / "episode.yaml").write_text("number: 0\nlabel: outside\n")
        (outside / "episode.bag").write_bytes((demos / FIRST / BAG).read_bytes())
        (outside / "broken.bag").write_bytes((demos / PART / f"{BAG}.active").read_bytes())
        how = list(MAKERS)[seed % len(MAKERS)]
        if how not in WITH_PART:
            shutil.rmtree(demos / PART)
        MAKERS[how](Place(random.Random(f"folder {seed}"), demos, outside))
        yield Hostile(seed, how, demos, outside)
