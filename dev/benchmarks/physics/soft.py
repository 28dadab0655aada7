"""Soft bodies."""

from __future__ import annotations

import math
import tempfile
from itertools import permutations, product
from pathlib import Path
from typing import Any

from custom_ros_tools.errors import PhysicsError

from .contact import floor_force
from .motion import step_name
from .scene import CLOSED_FORM, GRAVITY, Cell, Table, box_floor, run, scene

EDGE_M = 0.2
MASS_KG = 2.0
TIME_STEPS_S = (0.032, 0.016, 0.008, 0.004)


def weighing() -> Table:
    """Force of a soft cube of 2 kg on the floor, by time step and stiffness of the cube."""
    rows = []
    for pascals in (4e3, 4e5):
        cells: list[Cell] = []
        for time_step_s in TIME_STEPS_S:
            cells.append(_weight(time_step_s, pascals))
        rows.append((f"`NeoHookeanMu: {pascals:.1e}`", (*cells, MASS_KG * GRAVITY)))
    return Table(("force on the floor [N]", *map(step_name, TIME_STEPS_S), CLOSED_FORM), rows)


def _weight(time_step_s: float, pascals: float) -> float | str:
    """Returns the mean force over a second, after half a second [N], or how it ended."""
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        cube: dict[str, Any] = {
            "fileName": _write_cube(Path(folder)),
            "basePosition": [0.0, 0.0, EDGE_M / 2 + 0.005],
            "mass": MASS_KG,
            "useNeoHookean": True,
            "NeoHookeanMu": pascals,
            "NeoHookeanLambda": 2 * pascals,
            "NeoHookeanDamping": 0.02,
            "collisionMargin": 0.004,
            "frictionCoeff": 0.5,
            "repulsionStiffness": 800.0,
        }
        floor = box_floor(contacts={"hz": 1.0 / time_step_s, "arrows_hz": 0})
        main = {"resetSimulation": {"flags": "RESET_USE_DEFORMABLE_WORLD"}}
        soft = [{"name": "cube", "loadSoftBody": cube, "surface_hz": 0}]
        with scene(time_step_s, main=main, collision_objects=[floor], soft_objects=soft) as world:
            try:
                run(world, 0.5)
                force = floor_force(world, 1.0)
                highest = max(node[2] for node in world.bodies["cube"].state().nodes)
            except PhysicsError:
                return "blows up"
    return force if math.isfinite(highest) and 0.0 < highest < 2 * EDGE_M else "blows up"


def _write_cube(folder: Path, across: int = 3) -> str:
    """Writes a cube of tetrahedra about the origin and returns its file."""
    corners = list(product(range(across + 1), repeat=3))
    number = {corner: index for index, corner in enumerate(corners)}
    cells = []
    for base in product(range(across), repeat=3):
        for axes in permutations(range(3)):
            path = [base]
            for axis in axes:
                path.append(tuple(each + (axis == index) for index, each in enumerate(path[-1])))
            is_even = axes in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
            a, b, c, d = (number[corner] for corner in path)
            cells.append((a, b, c, d) if is_even else (a, c, b, d))
    lines = ["# vtk DataFile Version 2.0", "cube", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {len(corners)} float")
    lines += [" ".join(f"{EDGE_M * (each / across - 0.5):.6f}" for each in corner) for corner in corners]
    lines.append(f"CELLS {len(cells)} {5 * len(cells)}")
    lines += [f"4 {' '.join(map(str, cell))}" for cell in cells]
    lines += [f"CELL_TYPES {len(cells)}", *["10"] * len(cells)]
    path = folder / "cube.vtk"
    path.write_text("\n".join(lines) + "\n")
    return str(path)
