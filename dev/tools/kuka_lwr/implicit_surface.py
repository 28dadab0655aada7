"""Smooth solids as signed distance fields, and their conversion to triangle meshes (NumPy only).

A field maps points, shape (n, 3) [m], to signed distances, shape (n,) [m]: negative inside. Blended with
`smooth_min` and `smooth_max`, solids flow into one another like cast metal.
"""

from collections.abc import Callable

import numpy as np
from mesh import Mesh
from numpy.typing import NDArray

Array = NDArray[np.float64]
Field = Callable[[Array], Array]
Corner = tuple[float, float, float]


def smooth_min(a: Array, b: Array, blend: float) -> Array:
    """Union of two solids whose seam is filled over a width of about `blend` [m]; exact further away."""
    overlap = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.minimum(a, b) - overlap**2 * blend / 4.0


def smooth_max(a: Array, b: Array, blend: float) -> Array:
    """Intersection of two solids whose edge is rounded over a width of about `blend` [m]."""
    return -smooth_min(-a, -b, blend)


def rounded_box(offsets: list[Array], half_sizes: list[float], rounding: float) -> Array:
    """Exact distance to a box with rounded edges in two or three dimensions.

    With the two coordinates (radius, height) this is a disc with rounded rims.

    Args:
        offsets: Coordinates relative to the centre of the box, one array per axis [m].
        half_sizes: Half edge lengths, rounding included, one per axis [m].
        rounding: Radius of the edges [m].
    """
    outside = np.stack([np.abs(o) - h + rounding for o, h in zip(offsets, half_sizes, strict=True)])
    return np.linalg.norm(np.maximum(outside, 0.0), axis=0) + np.minimum(outside.max(axis=0), 0.0) - rounding


def disc(radius: Array, height: Array, size: float, low: float, high: float, rounding: float) -> Array:
    """Exact distance to a solid cylinder between two heights, given distances from and along its axis [m]."""
    return rounded_box([radius, height - (low + high) / 2.0], [size, (high - low) / 2.0], rounding)


def polygonise(field: Field, low: Corner, high: Corner, cell: float) -> Mesh:
    """Mesh the zero level of a field by surface nets, then pull the vertices onto the surface.

    One vertex is put in each grid cell that the surface crosses and one quad across each crossed grid edge.
    The vertices are then alternately relaxed along and projected onto the surface, which evens out the
    triangles. Normals are the gradient of the field, so shading is smooth at any resolution.

    Args:
        field: Signed distance field; its zero level must be closed inside the box.
        low: Lowest corner of the sampled box [m].
        high: Highest corner of the sampled box [m].
        cell: Edge length of the grid cells [m].
    """
    axes = [np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True)]
    shape = tuple(len(a) for a in axes)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    inside = field(grid.reshape(-1, 3)).reshape(shape) < 0.0

    ends = (np.s_[:-1], np.s_[1:])
    count = np.sum([inside[i, j, k] for i in ends for j in ends for k in ends], axis=0)
    crossed = (count > 0) & (count < 8)
    index = np.full(crossed.shape, -1)
    index[crossed] = np.arange(crossed.sum())
    vertices = grid[:-1, :-1, :-1][crossed] + cell / 2.0

    quads = np.concatenate([_quads(inside, index, axis) for axis in range(3)])
    for _ in range(6):
        vertices = _project(field, _relax(vertices, quads), cell)
    vertices = _project(field, vertices, cell)
    return Mesh(vertices, gradient(field, vertices), _split(quads, vertices))


def gradient(field: Field, points: Array) -> Array:
    """Unit gradient of a field at points, shape (n, 3), by central differences."""
    steps = 1e-5 * np.eye(3)
    slope = np.stack([field(points + s) - field(points - s) for s in steps], axis=1)
    return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)


def _quads(inside: NDArray[np.bool_], index: NDArray[np.int_], axis: int) -> NDArray[np.int_]:
    """Quads across the crossed grid edges along one axis, outward side anticlockwise, shape (n, 4)."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners, cells = (np.moveaxis(a, (axis, u, v), (0, 1, 2)) for a in (inside, index))
    first, last = corners[:-1, 1:-1, 1:-1], corners[1:, 1:-1, 1:-1]
    ring = np.stack([cells[:, :-1, :-1], cells[:, 1:, :-1], cells[:, 1:, 1:], cells[:, :-1, 1:]], axis=-1)
    return np.concatenate([ring[first & ~last], ring[~first & last][:, ::-1]])


def _relax(vertices: Array, quads: NDArray[np.int_]) -> Array:
    """Move each vertex half way to the mean of its neighbours."""
    total, count = np.zeros_like(vertices), np.zeros(len(vertices))
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        np.add.at(total, quads[:, a], vertices[quads[:, b]])
        np.add.at(count, quads[:, a], 1.0)
    return 0.5 * vertices + 0.5 * total / count[:, None]


def _project(field: Field, vertices: Array, limit: float) -> Array:
    """Move vertices onto the zero level along the gradient, at most `limit` [m] a step."""
    for _ in range(4):
        vertices = vertices - np.clip(field(vertices), -limit, limit)[:, None] * gradient(field, vertices)
    return vertices


def _split(quads: NDArray[np.int_], vertices: Array) -> NDArray[np.int_]:
    """Split quads along their shorter diagonal into triangles, shape (2 n, 3)."""
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    swap = np.linalg.norm(a - c, axis=1) > np.linalg.norm(b - d, axis=1) + 1e-6
    rolled = np.where(swap[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([rolled[:, [0, 1, 2]], rolled[:, [0, 2, 3]]])
