"""Triangle meshes: solids of revolution, mass properties and Wavefront OBJ files (NumPy only)."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Mesh(NamedTuple):
    """A closed triangle mesh.

    Attributes:
        vertices: Points, shape (n, 3) [m].
        normals: Unit outward normals at the vertices, shape (n, 3).
        faces: Vertex indices, anticlockwise seen from outside, shape (m, 3).
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int_]


class MassProperties(NamedTuple):
    """Mass, centre and inertia of a homogeneous body.

    Attributes:
        volume: Enclosed volume [m^3].
        centre: Centre of mass, shape (3,) [m].
        inertia_per_mass: Inertia about the centre of mass, shape (3, 3), for a mass of 1 kg [m^2].
    """

    volume: float
    centre: Array
    inertia_per_mass: Array


def mass_properties(mesh: Mesh) -> MassProperties:
    """Integrate a closed mesh as a sum of signed tetrahedra between its faces and the origin."""
    corners = mesh.vertices[mesh.faces]
    volumes = np.linalg.det(corners) / 6.0
    volume = float(volumes.sum())
    sums = corners.sum(axis=1)
    centre = np.einsum("i,ij->j", volumes, sums) / 4.0 / volume
    # Second moment of a tetrahedron with a corner at the origin: V/20 (sum_k p_k p_k^T + s s^T), s = sum p_k.
    second = np.einsum("i,ikj,ikl->jl", volumes, corners, corners)
    second += np.einsum("i,ij,il->jl", volumes, sums, sums)
    second = second / 20.0 / volume - np.outer(centre, centre)
    return MassProperties(volume, centre, np.trace(second) * np.eye(3) - second)


def revolve(profile: list[tuple[float, float, float]], segments: int = 36, arc_points: int = 3) -> Mesh:
    """Turn an open polyline with rounded corners about the z axis.

    Args:
        profile: Corners (radius, height, fillet radius) [m], with the outside on the right hand of the walk.
            The mesh is closed if both ends lie on the axis. A fillet of 0 is a sharp edge.
        segments: Number of steps around the axis.
        arc_points: Points on each fillet.
    """
    points, normals = _round_corners(profile, arc_points)
    rows, angles = len(points), np.arange(segments) * 2.0 * np.pi / segments
    turn = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rows_around = (
        np.concatenate([a[:, None, :1] * turn, np.repeat(a[:, None, 1:], segments, axis=1)], axis=2)
        for a in (points, normals)
    )
    vertices, directions = (a.reshape(-1, 3) for a in rows_around)
    index = np.arange(rows * segments).reshape(rows, segments)[:-1]
    a, b = index.ravel(), np.roll(index, -1, axis=1).ravel()
    lower, upper = np.stack([a, b, b + segments], axis=1), np.stack([a, b + segments, a + segments], axis=1)
    return _drop_flat(Mesh(vertices, directions, np.concatenate([lower, upper])))


def merge(*meshes: Mesh) -> Mesh:
    """Merge several meshes into one."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    shifted = [mesh._replace(faces=mesh.faces + start) for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(*(np.concatenate(parts) for parts in zip(*shifted, strict=True)))


def moved(mesh: Mesh, x: float, y: float, z: float) -> Mesh:
    """The mesh shifted by (x, y, z) [m]."""
    return mesh._replace(vertices=mesh.vertices + [x, y, z])


def write_obj(path: Path, mesh: Mesh, material: str) -> None:
    """Write a mesh with normals, to 10 micrometres, naming a material of `materials.mtl` for RViz."""
    lines = ["# Made by make_meshes.py", "mtllib materials.mtl", f"usemtl {material}"]
    lines += ["v {:.5f} {:.5f} {:.5f}".format(*row) for row in np.round(mesh.vertices, 5) + 0.0]
    lines += ["vn {:.3f} {:.3f} {:.3f}".format(*row) for row in np.round(mesh.normals, 3) + 0.0]
    lines += ["f {0}//{0} {1}//{1} {2}//{2}".format(*row) for row in mesh.faces + 1]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def write_materials(path: Path, colours: dict[str, tuple[float, float, float]]) -> None:
    """Write a material library of slightly glossy colours (red, green, blue, each from 0 to 1)."""
    lines = ["# Made by make_meshes.py"]
    for name, (red, green, blue) in colours.items():
        colour = f"{red:.2f} {green:.2f} {blue:.2f}"
        lines += [f"newmtl {name}", f"Ka {colour}", f"Kd {colour}", "Ks 0.25 0.25 0.25", "Ns 40"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _round_corners(profile: list[tuple[float, float, float]], arc_points: int) -> tuple[Array, Array]:
    """Points and outward normals along a polyline with filleted corners, each of shape (n, 2)."""
    corners = np.array(profile)[:, :2]
    along = np.diff(corners, axis=0)
    sides = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    points, normals = [corners[0]], [sides[0]]
    fillets = [fillet for _, _, fillet in profile[1:-1]]
    for corner, fillet, before, after in zip(corners[1:-1], fillets, sides[:-1], sides[1:], strict=True):
        turn = np.sign(before[0] * after[1] - before[1] * after[0])
        bisector = (before + after) / (1.0 + before @ after)
        for weight in np.linspace(0.0, 1.0, arc_points if fillet else 2):
            normal = (1.0 - weight) * before + weight * after
            normal /= np.linalg.norm(normal)
            points.append(corner - turn * fillet * (bisector - normal))
            normals.append(normal)
    return np.array([*points, corners[-1]]), np.array([*normals, sides[-1]])


def _drop_flat(mesh: Mesh) -> Mesh:
    """Drop the triangles that vanish on the axis and at sharp edges, and the vertices they alone used."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    faces = mesh.faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12]
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], mesh.normals[used], faces.reshape(-1, 3))
