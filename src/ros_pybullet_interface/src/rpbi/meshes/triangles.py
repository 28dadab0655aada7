"""Reads triangles from mesh files, and computes volumes of meshes and of their convex hulls."""

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt

from custom_ros_tools.config import read_file
from robot_model.mesh_cache import cached, content_hash

MAX_BYTES = 64_000_000
"""Largest size of a mesh file [bytes]; a larger file is an error."""
Triangles = npt.NDArray[np.float64]
"""Corners of triangles [m], shape (n, 3, 3)."""


def read_triangles(path: str) -> list[Triangles]:
    """Reads the triangles of an OBJ or STL file, one array per part.

    A part is a whole STL file, or an object or group of an OBJ file. PyBullet makes a convex hull of each part.

    Raises:
        ValueError: If the file has another format, contains no triangles, or is broken.
        OSError: If the file cannot be read, or is too large.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".obj", ".stl"):
        raise ValueError(f"expected an OBJ or STL file, got {path}")
    data = read_file(path, MAX_BYTES)
    try:
        parts = [_read_stl(data)] if suffix == ".stl" else _read_obj(data.decode(errors="replace"))
    except (ValueError, IndexError) as error:
        raise ValueError(f"{path} is no mesh: {error}") from None
    parts = [part for part in parts if len(part)]
    if not parts or not all(np.isfinite(part).all() for part in parts):
        raise ValueError(f"{path} is no mesh: expected triangles with finite corners")
    return parts


def _read_stl(data: bytes) -> Triangles:
    rows = np.frombuffer(data[84:], np.dtype([("numbers", "<f4", 12), ("attribute", "<u2")]))
    return rows["numbers"].reshape(-1, 4, 3)[:, 1:].astype(float)


def _read_obj(text: str) -> list[Triangles]:
    corners: list[list[float]] = []
    parts: list[list[list[int]]] = [[]]
    for line in text.splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            corners.append([float(word) for word in words[:3]])
        elif kind in ("o", "g"):
            parts.append([])
        elif kind == "f":
            given = [int(word.split("/")[0]) for word in words]
            if any(number == 0 or abs(number) > len(corners) for number in given):
                raise ValueError(f"a face refers to a corner that does not exist; there are {len(corners)}")
            face = [number - 1 if number > 0 else number + len(corners) for number in given]
            parts[-1] += [[face[0], second, third] for second, third in zip(face[1:], face[2:])]
    points = np.array(corners, float).reshape(-1, 3)
    return [points[np.array(part, int).reshape(-1, 3)] for part in parts]


def volumes(path: str) -> tuple[float, float] | None:
    """Returns the volume [m^3] that a mesh encloses, and the total volume [m^3] of its parts' convex hulls.

    Returns None if the surface is not closed, or the mesh cannot be read. Results are cached; the key is a hash of the
    file's content.
    """
    found = "volumes.json"
    try:
        folder = cached(f"volumes-{content_hash(path)}", lambda made: _write(made / found, _volumes(path)))
        return tuple(json.loads((folder / found).read_text())) or None
    except (OSError, ValueError):
        return _volumes(path)


def _write(path: Path, value: tuple[float, float] | None) -> None:
    path.write_text(json.dumps(value or []))


def _volumes(path: str) -> tuple[float, float] | None:
    from scipy.spatial import ConvexHull, QhullError  # slow to import, and most worlds have no meshes

    try:
        parts = read_triangles(path)
        if not all(map(_is_closed, parts)):
            return None
        hulls = sum(float(ConvexHull(part.reshape(-1, 3)).volume) for part in parts)
    except (OSError, ValueError, QhullError):
        return None
    # sum of tetrahedra between each triangle and one corner of the part
    enclosed = sum(abs(float(np.linalg.det(part - part[0, 0]).sum())) / 6.0 for part in parts)
    return enclosed, hulls


def _is_closed(triangles: Triangles) -> bool:
    """Returns whether each edge belongs to two triangles with consistent orientation."""
    _, corners = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = corners.reshape(-1, 3)
    count = int(corners.max()) + 1
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    there, back = (np.sort(edges[:, one] * count + edges[:, other]) for one, other in ((0, 1), (1, 0)))
    return bool(np.array_equal(there, back))
