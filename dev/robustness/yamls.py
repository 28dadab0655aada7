"""Hostile YAML: objects that are invented from the schemas of their files, and good files with changed bytes."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from random import Random
from typing import Any

import yaml

from rpbi.world.schemas import file_schemas

from .texts import NAMES, NUMBERS, spoil

KINDS = {"dynamic_object": "dynamic", "robot": "robots", "urdf": "urdfs", "visual_object": "visual"}
"""Argument of `write_world` by kind of file."""
GOOD = {
    "dynamic_object": {
        "baseMass": 1.0,
        "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "createCollisionShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1},
        "changeDynamics": {"lateralFriction": 0.5},
    },
    "robot": {
        "loadURDF": {"fileName": "cartpole.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "initial_joint_position": {},
    },
    "urdf": {"loadURDF": {"fileName": "cube.urdf"}},
    "visual_object": {"createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": [1, 1, 1]}},
}
BAD: tuple[Any, ...] = (
    *(
        None,
        True,
        -1,
        0,
        1,
        2**31,
        2**63,
        10**400,
        1e300,
        float("nan"),
        float("inf"),
        [],
        {},
        [[]],
        {"a": {}},
        [1, 2, 3],
    ),
    *("", "x", "GEOM_MESH", ["x"] * 100, {"x": "y"}, "this:x", "os:system", "a" * 100_000, {1: 2}, {"type": "this:x"}),
)
TAGGED = (
    *("!!bool 3", '!!int ""', "!!timestamp x", "!!float x", "!!binary x", "!!set [a]", "!!omap x", "!!pairs [1]"),
    *("!!python/object/apply:os.mknod [canary]", "!!python/name:os.system", "!!map x", "!!seq x", "!!null x", "!x y"),
    *(
        "2001-99-99",
        "2001-01-01 99:99:99",
        "1:1:1:1",
        "0b",
        "0x",
        "0o9",
        ".inf",
        "-.nan",
        "? a",
        "<<: x",
        "*a",
        "&a *a",
    ),
    *(
        "&a [*a]",
        "{<<: *a}",
        "{<<: [1]}",
        "%TAG ! x",
        "|",
        ">-",
        "'",
        '"\\x',
        '"\\ud800"',
        "@",
        "`",
        "\t",
        "---",
        "...",
    ),
    *("1" * 5000, "1" + ":59" * 5000, "1" + ":59" * 5000 + ".0", "[" * 500, "{" * 3000, "- " * 3000, "? " * 2000, "\0"),
)


def write_yaml(random: Random, folder: Path) -> tuple[Path, str]:
    """Writes a hostile file of an object into a folder; returns its path and its kind."""
    kind = random.choice([*KINDS])
    path = folder / "it.yaml"
    good = {"name": "it", **GOOD[kind]}
    chance = random.random()
    if chance < 0.5:
        data = {**good, **_keys(random, _schemas()[kind], _schemas()[kind], 0)}
        text = yaml.safe_dump(data, allow_unicode=True)
    else:
        text = yaml.safe_dump(good)
        if chance < 0.75:
            lines = text.splitlines()
            at = random.randrange(len(lines))
            lines[at] = lines[at].partition(":")[0] + ": " + random.choice((*TAGGED, *NUMBERS, *NAMES))
            text = "\n".join(lines)
        elif chance < 0.77:
            text += random.choice(_LARGE)(random)
    content = text.encode(errors="replace")
    path.write_bytes(spoil(random, content) if chance >= 0.77 else content)
    return path, kind


@lru_cache(maxsize=1)
def _schemas() -> dict[str, Any]:
    return file_schemas()


def _keys(random: Random, schema: dict[str, Any], root: dict[str, Any], depth: int) -> dict[str, Any]:
    """Returns some of the keys that a schema has."""
    known = [*schema.get("properties", {})]
    chosen = random.sample(known, min(len(known), random.choice((1, 1, 2, 4))))
    found = {key: _value(random, schema["properties"][key], root, depth + 1) for key in chosen}
    return found | ({random.choice(NAMES): random.choice(BAD)} if random.random() < 0.1 else {})


def _value(random: Random, schema: dict[str, Any], root: dict[str, Any], depth: int) -> Any:
    if random.random() < 0.15 or depth > 6:
        return random.choice(BAD)
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    for choice in ("anyOf", "oneOf", "allOf"):
        if choice in schema:
            return _value(random, random.choice(schema[choice]), root, depth)
    if "enum" in schema:
        return random.choice(schema["enum"])
    kind = schema.get("type", "string")
    kind = random.choice(kind) if isinstance(kind, list) else kind
    if kind == "object":
        if "properties" not in schema and isinstance(inner := schema.get("additionalProperties"), dict):
            return {random.choice(NAMES): _value(random, inner, root, depth + 1)}
        return _keys(random, schema, root, depth)
    if kind == "array":
        inner = schema.get("items") or random.choice(schema.get("prefixItems") or [{"type": "number"}])
        count = random.choice((0, 1, 3, 3, 4, 50))
        return [_value(random, inner if isinstance(inner, dict) else {}, root, depth + 1) for _ in range(count)]
    plain: dict[str, Callable[[], Any]] = {
        "number": lambda: random.choice((0.0, 1.0, -1.0, 1e-9, 1e5, random.uniform(-10, 10))),
        "integer": lambda: random.choice((0, 1, 2, 7, -1, 2**31 - 1)),
        "boolean": lambda: random.random() < 0.5,
        "null": lambda: None,
        "string": lambda: random.choice((*NAMES, "cube.urdf", "cube.obj", "pipe.png", "/dev/zero", "FRAME")),
    }
    return plain.get(kind, lambda: None)()


_LADDER = "\n".join(f"k{turn}: &a{turn} {{<<: [*a{turn - 1}, *a{turn - 1}], x{turn}: 1}}" for turn in range(1, 30))
_LARGE: tuple[Callable[[Random], str], ...] = (
    lambda random: f"k0: &a0 {{y: 1}}\n{_LADDER}\n",
    lambda random: "a: " + "[" * random.choice((400, 5000)),
    lambda random: "b: [" + "1, " * random.choice((10_000, 100_000)) + "]\n",
    lambda random: "".join(f"k{index}: v\n" for index in range(random.choice((1000, 20_000)))),
    lambda random: "c: '" + "x" * 2_100_000 + "'\n",
    lambda random: "# " + "y" * 1_000_000 + "\n",
    lambda random: "d: " + "1" * 1_000_000 + "\n",
    lambda random: "e: 1" + ":59" * 300_000 + "\n",
)
