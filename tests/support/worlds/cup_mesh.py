"""A cup as a mesh: a closed surface that is turned about z."""

from __future__ import annotations

import math
from pathlib import Path

RADIUS_M, HEIGHT_M, WALL_M = 0.05, 0.1, 0.01
SEGMENTS = 24
PROFILE_M = (
    (0.0, 0.0),
    (RADIUS_M, 0.0),
    (RADIUS_M, HEIGHT_M),
    (RADIUS_M - WALL_M, HEIGHT_M),
    (RADIUS_M - WALL_M, WALL_M),
    (0.0, WALL_M),
)
"""Distance from the axis and height of each corner, from the middle of the foot to the middle of the bottom inside."""
_POLYGON = SEGMENTS * math.sin(2 * math.pi / SEGMENTS) / 2
HULL_M3 = _POLYGON * RADIUS_M**2 * HEIGHT_M
CUP_M3 = HULL_M3 - _POLYGON * (RADIUS_M - WALL_M) ** 2 * (HEIGHT_M - WALL_M)


def cup_triangles() -> tuple[list[tuple[float, float, float]], list[tuple[int, int, int]]]:
    """Returns the corners [m], and the numbers of three corners for each triangle."""
    rings, corners = [], []
    for radius, height in PROFILE_M:
        angles = [2 * math.pi * number / SEGMENTS for number in range(SEGMENTS if radius else 1)]
        rings.append([len(corners) + number for number in range(len(angles))])
        corners += [(radius * math.cos(angle), radius * math.sin(angle), height) for angle in angles]
    triangles = []
    for lower, upper in zip(rings, rings[1:]):
        for number in range(SEGMENTS):
            a, b = (lower[(number + step) % len(lower)] for step in (0, 1))
            c, d = (upper[(number + step) % len(upper)] for step in (0, 1))
            triangles += [each for each in ((a, b, d), (a, d, c)) if len(set(each)) == 3]
    return corners, triangles


def write_cup(path: Path) -> Path:
    """Writes it as an OBJ file and returns that."""
    corners, triangles = cup_triangles()
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    path.write_text("\n".join(lines) + "\n")
    return path
