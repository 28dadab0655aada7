"""Writes the shapes and the texture of the examples' scenery.

PyBullet's EGL renderer shades GEOM_BOX and GEOM_CYLINDER as if they were balls: it takes the direction from the centre
for the normal at each corner, and so floors get seams and boxes look inflated. Meshes bring normals of their own.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

FOLDER = Path(__file__).parents[3] / "src/rpbi_examples/configs/meshes"
FLOOR_M = 12
"""Edge of the floor [m]; its tiles have edges of 1 m."""
TILE_PX, JOINT_PX, JOINT_GREY = 256, 2, 205
DISC_CORNERS = 96

CUBE = """\
# A cube with edges of 1 m about the origin.
v -0.5 -0.5 -0.5
v 0.5 -0.5 -0.5
v 0.5 0.5 -0.5
v -0.5 0.5 -0.5
v -0.5 -0.5 0.5
v 0.5 -0.5 0.5
v 0.5 0.5 0.5
v -0.5 0.5 0.5
vn -1 0 0
vn 1 0 0
vn 0 -1 0
vn 0 1 0
vn 0 0 -1
vn 0 0 1
f 1//1 5//1 8//1
f 1//1 8//1 4//1
f 2//2 3//2 7//2
f 2//2 7//2 6//2
f 1//3 2//3 6//3
f 1//3 6//3 5//3
f 4//4 8//4 7//4
f 4//4 7//4 3//4
f 1//5 4//5 3//5
f 1//5 3//5 2//5
f 5//6 6//6 7//6
f 5//6 7//6 8//6
"""

FLOOR = f"""\
# A square in the x-y plane about the origin, tiled.
mtllib floor.mtl
usemtl floor
v {-FLOOR_M / 2} {-FLOOR_M / 2} 0
v {FLOOR_M / 2} {-FLOOR_M / 2} 0
v {FLOOR_M / 2} {FLOOR_M / 2} 0
v {-FLOOR_M / 2} {FLOOR_M / 2} 0
vt 0 0
vt {FLOOR_M} 0
vt {FLOOR_M} {FLOOR_M}
vt 0 {FLOOR_M}
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/4/1
"""

FLOOR_MATERIAL = """\
newmtl floor
Kd 1 1 1
map_Kd floor.png
"""


def disc() -> str:
    """Returns a disc of radius 1 m in the x-y plane about the origin, seen from above."""
    angles = 2.0 * np.pi * np.arange(DISC_CORNERS) / DISC_CORNERS
    lines = ["# A disc of radius 1 m in the x-y plane about the origin.", "v 0 0 0"]
    lines += [f"v {x:.5f} {y:.5f} 0" for x, y in zip(np.cos(angles), np.sin(angles))]
    lines += ["vn 0 0 1"]
    lines += [f"f 1//1 {n + 2}//1 {(n + 1) % DISC_CORNERS + 2}//1" for n in range(DISC_CORNERS)]
    return "\n".join(lines) + "\n"


def tile() -> Image.Image:
    """Returns a white tile with half a grey joint on each side."""
    pixels = np.full((TILE_PX, TILE_PX), JOINT_GREY, np.uint8)
    pixels[JOINT_PX:-JOINT_PX, JOINT_PX:-JOINT_PX] = 255
    return Image.fromarray(pixels)


if __name__ == "__main__":
    (FOLDER / "cube.obj").write_text(CUBE)
    (FOLDER / "floor.obj").write_text(FLOOR)
    (FOLDER / "floor.mtl").write_text(FLOOR_MATERIAL)
    (FOLDER / "disc.obj").write_text(disc())
    tile().save(FOLDER / "floor.png", optimize=True)
