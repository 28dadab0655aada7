"""Small worlds for measurements of physics, and tables of the results."""

from __future__ import annotations

import contextlib
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from result import Result

from rpbi.world import World

GRAVITY = 9.81
MAXIMAL = {"useMaximalCoordinates": True}
"""What an object's YAML says to be in maximal coordinates."""
UNDAMPED = {"linearDamping": 0.0, "angularDamping": 0.0}
CLOSED_FORM = "closed form"
"""The column of a table with the correct value."""


class Span(NamedTuple):
    """Smallest and largest value of several measurements."""

    least: float
    most: float

    def __str__(self) -> str:
        return f"{self.least:.3f} to {self.most:.3f}"


Cell = float | str | Span


class Table(NamedTuple):
    """What was measured of one thing.

    Attributes:
        columns: Headings; the first one is of the rows' names.
        rows: Name and values of each.
    """

    columns: tuple[str, ...]
    rows: list[tuple[str, tuple[Cell, ...]]]

    def markdown(self) -> str:
        """Returns it as the page has it."""
        lines = [self.columns, tuple("---" for _ in self.columns)]
        lines += [(name, *map(_shown, values)) for name, values in self.rows]
        return "\n".join(f"| {' | '.join(line)} |" for line in lines)

    def results(self, about: str) -> list[Result]:
        """Returns its numbers as figures; the closed form, if it has one, is their lower bound."""
        found = []
        for name, values in self.rows:
            cells = dict(zip(self.columns[1:], values))
            closed = cells.pop(CLOSED_FORM, None)
            floor = closed if isinstance(closed, float) else None
            for column, value in cells.items():
                parts = value._asdict() if isinstance(value, Span) else {"": value}
                found += [
                    Result("physics", ", ".join(filter(None, (f"{about}: {name}", column, part))), number, "", floor)
                    for part, number in parts.items()
                    if isinstance(number, float)
                ]
        return found


def _shown(value: Cell) -> str:
    """Returns a cell; values below 0.0001 are written as 0."""
    if isinstance(value, (str, Span)):
        return str(value)
    return "0" if abs(value) < 1e-4 else f"{value:.4g}"


@contextlib.contextmanager
def scene(
    time_step_s: float = 0.001,
    engine: Mapping[str, Any] | None = None,
    gravity: Sequence[float] = (0.0, 0.0, -GRAVITY),
    main: Mapping[str, Any] | None = None,
    **sections: Sequence[dict[str, Any]],
) -> Iterator[World]:
    """Builds a world and closes it afterwards.

    Args:
        time_step_s: Length of a tick [s].
        engine: Keys of `setPhysicsEngineParameter`.
        gravity: Acceleration [m/s^2].
        main: Further keys of the main file.
        sections: Objects by the main file's list.
    """
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        config: dict[str, Any] = {
            "connect": {"connection_mode": "DIRECT"},
            "setGravity": dict(zip(("gravX", "gravY", "gravZ"), gravity)),
            "timeStep": time_step_s,
            "setPhysicsEngineParameter": dict(engine or {}),
            **(main or {}),
        }
        for section, objects in sections.items():
            config[section] = [f"{item['name']}.yaml" for item in objects]
            for item in objects:
                if urdf := item.pop("urdf", None):
                    (Path(folder) / f"{item['name']}.urdf").write_text(urdf)
                    item.setdefault("loadURDF", {})["fileName"] = f"{item['name']}.urdf"
                (Path(folder) / f"{item['name']}.yaml").write_text(yaml.safe_dump(item))
        path = Path(folder) / "world.yaml"
        path.write_text(yaml.safe_dump(config))
        world = World.from_file(str(path))
        try:
            yield world
        finally:
            world.close()


def box_floor(half_width_m: float = 3.0, **more: Any) -> dict[str, Any]:
    """Returns a floor at height 0 that is the upper side of a box, of friction 1."""
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [half_width_m, half_width_m, 0.5]}
    return {
        "name": "floor",
        "createVisualShape": {**shape, "visualFramePosition": [0.0, 0.0, -0.5]},
        "createCollisionShape": {**shape, "collisionFramePosition": [0.0, 0.0, -0.5]},
        "changeDynamics": {"lateralFriction": 1.0, "restitution": 1.0},
        **more,
    }


def plane_floor(**more: Any) -> dict[str, Any]:
    """Returns a floor at height 0 that is a plane, of friction 1."""
    plane = {"shapeType": "GEOM_PLANE", "planeNormal": [0.0, 0.0, 1.0]}
    return {**box_floor(), "createCollisionShape": plane, **more}


def floor_of_tf(**more: Any) -> dict[str, Any]:
    """Returns a floor whose upper side is 0.5 m above its frame, which TF has to move there."""
    shape = {"shapeType": "GEOM_BOX", "halfExtents": [3.0, 3.0, 0.5]}
    return {
        **box_floor(),
        "createVisualShape": shape,
        "createCollisionShape": shape,
        "object_tf": {"tf_id": "floor"},
        **more,
    }


def box(name: str, half_m: Sequence[float], height_m: float | None = None, yaw: float = 0.0, **more: Any) -> Any:
    """Returns a box of 1 kg, without damping.

    Args:
        name: Its name.
        half_m: Half its edges [m].
        height_m: Height of its centre [m]; without it, it rests on the floor.
        yaw: How it is turned [rad].
        more: Further keys; those of `changeDynamics` are added to its own.
    """
    shape = {"shapeType": "GEOM_BOX", "halfExtents": list(half_m)}
    height = half_m[2] if height_m is None else height_m
    return _thing(name, shape, height, **{"baseOrientation": quat_about_z(yaw), **more})


def ball(name: str, radius_m: float, height_m: float | None = None, **more: Any) -> dict[str, Any]:
    """Returns a ball of 1 kg, without damping; the arguments are those of `box`."""
    return _thing(name, {"shapeType": "GEOM_SPHERE", "radius": radius_m}, height_m or radius_m, **more)


def _thing(name: str, shape: dict[str, Any], height_m: float, **more: Any) -> dict[str, Any]:
    return {
        "name": name,
        "createVisualShape": shape,
        "createCollisionShape": shape,
        "baseMass": 1.0,
        "basePosition": [0.0, 0.0, height_m],
        **more,
        "changeDynamics": {**UNDAMPED, **more.get("changeDynamics", {})},
    }


def quat_about_z(yaw: float) -> list[float]:
    """Returns x, y, z, w of a turn about the vertical [rad]."""
    return [0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)]


def run(world: World, seconds: float) -> None:
    """Goes on for so long [s]."""
    for _ in range(round(seconds / world.config.timeStep)):
        world.step()


def velocity(world: World, name: str) -> tuple[Sequence[float], Sequence[float]]:
    """Returns linear [m/s] and angular [rad/s] velocity of a body."""
    twist = world.bodies[name].base_twist()
    return twist.linear, twist.angular


def height(world: World, name: str) -> float:
    """Returns how high a body is [m]."""
    return world.bodies[name].base_pose().position[2]
