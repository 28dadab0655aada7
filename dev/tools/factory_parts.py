"""Draws the parts of the example `factory`: meshes of three kinds with an AprilTag on top, and their common picture.

python3 dev/tools/factory_parts.py      # in ./rpbi shell; writes src/rpbi_examples/configs/factory/parts
"""

import math
from pathlib import Path

import numpy as np
from PIL import Image

from rpbi_utils.tracking.tags import CELLS, tag_image

FOLDER = Path(__file__).parents[2] / "src/rpbi_examples/configs/factory/parts"
PIXELS_A_CELL = 16
TILE_PX = PIXELS_A_CELL * (CELLS + 2)
COLOURS = {"cube": (237, 135, 36), "cylinder": (41, 115, 191), "block": (64, 158, 97)}
BOXES_M = {"cube": (0.04, 0.04, 0.04), "block": (0.06, 0.035, 0.03)}
RADIUS_M, HEIGHT_M, SIDES = 0.022, 0.05, 40
"""The cylinder; its visible shape is a prism."""
TAGS_M = {"cube": 0.026, "cylinder": 0.022, "block": 0.026}
"""Side of the black square of the tags."""
NAMES = [f"{kind}_{number}" for kind in COLOURS for number in (1, 2)]
"""Parts, in the order of their tags, whose numbers begin with 1."""
LIFT_M = 0.0003
"""Height of tags above the surface."""
MTL = "newmtl part\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nmap_Kd parts.png\n"
Face = list[tuple[float, float, float]]


def tile_corners(number: int) -> list[tuple[float, float]]:
    """Returns the corners of a tile of the picture, which has three rows of three, from its lower left on."""
    row, column = divmod(number, 3)
    left, low = column / 3.0, 1.0 - (row + 1) / 3.0
    return [(left, low), (left + 1 / 3, low), (left + 1 / 3, low + 1 / 3), (left, low + 1 / 3)]


def box_faces(size: tuple[float, float, float]) -> list[Face]:
    """Returns the six faces of a box around the origin, seen from outside in the positive sense."""
    half = np.array(size) / 2.0
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    faces = []
    for axis in range(3):
        for sign in (1, -1):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = np.array(square[::sign]).T
            faces.append([tuple(each) for each in (corners * half).tolist()])
    return faces


def prism_faces() -> list[Face]:
    """Returns the faces of the cylinder."""
    angles = 2.0 * math.pi * np.arange(SIDES + 1) / SIDES
    rim = [(RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle)) for angle in angles]
    top = HEIGHT_M / 2.0
    sides = [[(*a, -top), (*b, -top), (*b, top), (*a, top)] for a, b in zip(rim, rim[1:])]
    return [*sides, [(*each, top) for each in rim[:-1]], [(*each, -top) for each in rim[-2::-1]]]


def obj(kind: str, number: int) -> str:
    """Returns the mesh of a part with the tag of a number on top."""
    faces = prism_faces() if kind == "cylinder" else box_faces(BOXES_M[kind])
    top = (HEIGHT_M if kind == "cylinder" else BOXES_M[kind][2]) / 2.0 + LIFT_M
    half = TAGS_M[kind] / 2.0 * (CELLS + 2) / CELLS
    corners = tile_corners(6 + list(COLOURS).index(kind))
    middle = tuple(np.mean(corners, axis=0))
    drawn = [(face, [middle] * len(face)) for face in faces]
    square = [(-half, -half, top), (half, -half, top), (half, half, top), (-half, half, top)]
    drawn.append((square, tile_corners(number)))
    title = f"# A {kind} with tag36h11 {number + 1} on top; dev/tools/factory_parts.py drew it."
    lines, count = [title, "mtllib parts.mtl", "usemtl part"], 1
    for index, (face, places) in enumerate(drawn, 1):
        normal = np.cross(np.subtract(face[1], face[0]), np.subtract(face[2], face[0]))
        lines += ["v {:.6g} {:.6g} {:.6g}".format(*corner) for corner in face]
        lines += ["vt {:.6g} {:.6g}".format(*place) for place in places]
        lines.append("vn {:.6g} {:.6g} {:.6g}".format(*(normal / np.linalg.norm(normal) + 0.0)))
        for second in range(1, len(face) - 1):
            lines.append("f " + " ".join(f"{count + each}/{count + each}/{index}" for each in (0, second, second + 1)))
        count += len(face)
    return "\n".join(lines) + "\n"


def main() -> None:
    """Writes the files."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    picture = np.zeros((3 * TILE_PX, 3 * TILE_PX, 3), np.uint8)
    for number in range(6):
        tag = np.kron(tag_image(number + 1), np.ones((PIXELS_A_CELL, PIXELS_A_CELL), np.uint8))
        row, column = divmod(number, 3)
        picture[row * TILE_PX : (row + 1) * TILE_PX, column * TILE_PX : (column + 1) * TILE_PX] = tag[..., None]
    for column, colour in enumerate(COLOURS.values()):
        picture[2 * TILE_PX :, column * TILE_PX : (column + 1) * TILE_PX] = colour
    Image.fromarray(picture).save(FOLDER / "parts.png", optimize=True)
    (FOLDER / "parts.mtl").write_text(MTL)
    for number, name in enumerate(NAMES):
        (FOLDER / f"{name}.obj").write_text(obj(name.partition("_")[0], number))


if __name__ == "__main__":
    main()
