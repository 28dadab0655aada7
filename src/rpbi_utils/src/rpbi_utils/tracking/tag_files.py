"""`make_april_tag`: a textured square for a world, with an AprilTag on it."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from custom_ros_tools.errors import InterfaceError

from .config import FAMILY_SIZE
from .tags import CELLS, tag_image

PIXELS_A_CELL = 32
OBJ = """\
# Square with tag36h11 {number}; the side of its black square is {size:g} m. x to the right, y up, z out of the tag.
mtllib {name}.mtl
usemtl tag
v {low:.9g} {low:.9g} 0
v {high:.9g} {low:.9g} 0
v {high:.9g} {high:.9g} 0
v {low:.9g} {high:.9g} 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/4/1
"""
MTL = """\
newmtl tag
Ka 1 1 1
Kd 1 1 1
Ks 0 0 0
map_Kd {name}.png
"""


def write_tag(number: int, size: float, folder: Path) -> Path:
    """Writes a mesh with its material and picture.

    Args:
        number: Id of the tag.
        size: Side of the black square [m]; the white margin is another eighth on each side.
        folder: Target folder; it is created if missing.

    Returns:
        The path of the mesh.
    """
    picture = np.kron(tag_image(number), np.ones((PIXELS_A_CELL, PIXELS_A_CELL), np.uint8))
    folder.mkdir(parents=True, exist_ok=True)
    name = f"tag36h11_{number}"
    Image.fromarray(picture).convert("RGB").save(folder / f"{name}.png")
    half = size / 2.0 * (CELLS + 2) / CELLS
    (folder / f"{name}.mtl").write_text(MTL.format(name=name))
    mesh = folder / f"{name}.obj"
    mesh.write_text(OBJ.format(name=name, number=number, size=size, low=-half, high=half))
    return mesh


def main() -> None:
    """Runs the command."""
    parser = argparse.ArgumentParser(
        prog="make_april_tag", description="Makes a mesh of an AprilTag (tag36h11) for `createVisualShape`."
    )
    parser.add_argument("id", type=int, help=f"number of the tag, below {FAMILY_SIZE}")
    parser.add_argument("size", type=float, help="side of its black square [m]")
    parser.add_argument("folder", type=Path, nargs="?", default=Path(), help="where to put it; here by default")
    given = parser.parse_args()
    if not 0 <= given.id < FAMILY_SIZE:
        parser.error(f"id: tag36h11 has ids from 0 to {FAMILY_SIZE - 1}, got {given.id}")
    if not 0.0 < given.size < 1e3:
        parser.error(f"size: expected more than 0 and less than 1000 m, got {given.size:g}")
    try:
        print(write_tag(given.id, given.size, given.folder))
    except (InterfaceError, OSError) as error:
        parser.exit(1, f"{parser.prog}: {error}\n")
