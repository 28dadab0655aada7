"""Meshes of soft bodies for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

DEFORMABLE = {"resetSimulation": {"flags": "RESET_USE_DEFORMABLE_WORLD"}}
"""What the main file of a world for soft bodies says."""
GROUND: dict[str, Any] = {
    "name": "ground",
    "createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": [2, 2, 0.5], "visualFramePosition": [0, 0, -0.5]},
    "createCollisionShape": {
        "shapeType": "GEOM_BOX",
        "halfExtents": [2, 2, 0.5],
        "collisionFramePosition": [0, 0, -0.5],
    },
}
"""A box, since PyBullet keeps soft bodies 0.1 m off a plane."""
MASS_KG = 2.0


def write_block(folder: Path, name: str = "block.vtk", edge_m: float = 0.2, across: int = 3) -> str:
    """Writes a cube of tetrahedra about the origin and returns its file; node 0 is its lowest corner."""
    side = range(across + 1)
    number = {(x, y, z): i for i, (x, y, z) in enumerate((x, y, z) for x in side for y in side for z in side)}
    points = [[edge_m * (each / across - 0.5) for each in place] for place in number]
    cells = []
    for x in range(across):
        for y in range(across):
            for z in range(across):
                c = [number[x + i, y + j, z + k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
                cells += [(c[0], c[a], c[b], c[7]) for a, b in ((4, 6), (6, 2), (2, 3), (3, 1), (1, 5), (5, 4))]
    lines = ["# vtk DataFile Version 2.0", "block", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {len(points)} float", *(" ".join(f"{each:.6f}" for each in point) for point in points)]
    lines += [f"CELLS {len(cells)} {5 * len(cells)}", *("4 " + " ".join(map(str, cell)) for cell in cells)]
    lines += [f"CELL_TYPES {len(cells)}", *["10"] * len(cells)]
    (folder / name).write_text("\n".join(lines) + "\n")
    return str(folder / name)


def block(folder: Path, name: str = "jelly", **more: Any) -> dict[str, Any]:
    """Returns the configuration of a soft cube with edges of 0.2 m."""
    load = {
        "fileName": write_block(folder),
        "basePosition": [0.0, 0.0, 1.0],
        "mass": MASS_KG,
        "useNeoHookean": True,
        "NeoHookeanMu": 4000.0,
        "NeoHookeanLambda": 8000.0,
        "NeoHookeanDamping": 0.02,
        "collisionMargin": 0.004,
        "frictionCoeff": 0.5,
        "repulsionStiffness": 800.0,
        **more.pop("load", {}),
    }
    return {"name": name, "loadSoftBody": load, **more}
