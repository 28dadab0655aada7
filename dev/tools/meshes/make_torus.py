"""Writes a torus to its own folder: torus.vtk of tetrahedra, to be simulated as a soft body, and its visible mesh.

PyBullet's EGL renderer shows soft bodies with checks unless they have a texture of their own, so torus.obj brings one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

RADIUS_M, TUBE_RADIUS_M = 0.75, 0.25
AROUND, ACROSS = 24, 8
"""Cross-sections, and corners on the circle of each; one more corner is in its middle."""
STRIPES = ((214, 68, 48), (240, 214, 196))
"""Colours of every other two cross-sections."""
MATERIAL = """\
newmtl torus
Kd 1 1 1
map_Kd torus.png
"""


def corners() -> npt.NDArray[np.float64]:
    """Returns the corners [m], section by section, the middle of each first; shape (n, 3)."""
    angle = 2.0 * np.pi * np.arange(ACROSS) / ACROSS
    radial = RADIUS_M + TUBE_RADIUS_M * np.array([0.0, *np.cos(angle)])
    height = TUBE_RADIUS_M * np.array([0.0, *np.sin(angle)])
    turns = 2.0 * np.pi * np.arange(AROUND) / AROUND
    sections = [np.stack([radial * np.cos(turn), radial * np.sin(turn), height], axis=1) for turn in turns]
    return np.concatenate(sections)


def tetrahedra() -> npt.NDArray[np.int64]:
    """Returns the numbers of four corners each, shape (m, 4).

    Each wedge between two sections, from the middle to a side of the outline, becomes three tetrahedra. Wedges agree on
    the diagonals of the faces that they share, since all go from the lower number in one section to the higher in the
    next.
    """
    found = []
    for section in range(AROUND):
        here, there = section * (ACROSS + 1), (section + 1) % AROUND * (ACROSS + 1)
        for side in range(ACROSS):
            a, b, c = 0, *sorted((side + 1, (side + 1) % ACROSS + 1))
            found += [
                (here + a, here + b, here + c, there + c),
                (here + a, here + b, there + b, there + c),
                (here + a, there + a, there + b, there + c),
            ]
    return _right_handed(np.array(found))


def _right_handed(cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Returns the cells with their corners in the order that makes all volumes positive."""
    first, *others = np.moveaxis(corners()[cells], 1, 0)
    turned = np.linalg.det(np.stack([other - first for other in others], axis=1)) < 0.0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return cells


def vtk() -> str:
    """Returns the text of a VTK file as PyBullet reads it: one corner and one cell a line."""
    points, cells = corners(), tetrahedra()
    lines = ["# vtk DataFile Version 2.0", "Torus about z, written by make_torus.py", "ASCII"]
    lines += ["DATASET UNSTRUCTURED_GRID", f"POINTS {len(points)} float"]
    lines += [f"{x:.5f} {y:.5f} {z:.5f}" for x, y, z in points]
    lines += [f"CELLS {len(cells)} {5 * len(cells)}"]
    lines += [f"4 {a} {b} {c} {d}" for a, b, c, d in cells]
    lines += [f"CELL_TYPES {len(cells)}", *["10"] * len(cells)]
    return "\n".join(lines) + "\n"


def obj() -> str:
    """Returns the surface as the text of a Wavefront OBJ file, with normals and a place on the texture."""
    points = corners().reshape(AROUND, ACROSS + 1, 3)
    lines = ["# Torus about z, written by make_torus.py", "mtllib torus.mtl", "usemtl torus"]
    lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in points[:, 1:].reshape(-1, 3)]
    outward = (points[:, 1:] - points[:, :1]).reshape(-1, 3) / TUBE_RADIUS_M
    lines += [f"vn {x:.5f} {y:.5f} {z:.5f}" for x, y, z in outward]
    lines += ["vt 0.25 0.5", "vt 0.75 0.5"]
    for section in range(AROUND):
        stripe = section // 2 % 2 + 1
        here, there = section * ACROSS + 1, (section + 1) % AROUND * ACROSS + 1
        for side in range(ACROSS):
            after = (side + 1) % ACROSS
            for triangle in ((here + side, there + side, here + after), (here + after, there + side, there + after)):
                lines.append("f " + " ".join(f"{corner}/{stripe}/{corner}" for corner in triangle))
    return "\n".join(lines) + "\n"


def stripes() -> Image.Image:
    """Returns both colours side by side."""
    pixels = np.repeat(np.array([STRIPES], np.uint8), 8, axis=1)
    return Image.fromarray(np.repeat(pixels, 8, axis=0))


if __name__ == "__main__":
    folder = Path(__file__).parents[3] / "src/rpbi_examples/configs/meshes"
    (folder / "torus.vtk").write_text(vtk())
    (folder / "torus.obj").write_text(obj())
    (folder / "torus.mtl").write_text(MATERIAL)
    stripes().save(folder / "torus.png", optimize=True)
