"""Checks meshes for errors that PyBullet does not report."""

import math
import os
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path

from custom_ros_tools.config import read_file
from rpbi.config.pybullet_models import CreateCollisionShape, CreateVisualShape

SOFT_MESH_FORMATS = (".obj", ".vtk")


def mesh_problems(shape: CreateVisualShape | CreateCollisionShape) -> list[tuple[str, str]]:
    """Returns the YAML key and a message for each error in the mesh of a shape."""
    problems = []
    if shape.fileName is not None and (problem := mesh_file_problem(shape.fileName)):
        problems.append(("fileName", f"{problem}: {shape.fileName}"))
    if shape.indices is not None:
        corners = len(shape.vertices or ())
        if len(shape.indices) % 3:
            problems.append(("indices", f"expected three for each triangle, got {len(shape.indices)} of them"))
        if any(index >= corners for index in shape.indices):
            problems.append(("indices", f"expected numbers of the {corners} vertices, got {max(shape.indices)}"))
    return problems


def mesh_file_problem(path: str) -> str:
    """Returns why PyBullet would silently ignore a mesh file; empty if no reason is found."""
    if path.lower().endswith(".stl") and not _is_binary_stl(path):
        return "expected a whole binary STL file, got another kind or a part"
    return ""


def check_obj(lines: Iterable[bytes]) -> None:
    """Checks corners and faces of an OBJ file. PyBullet reads invalid memory if a face refers to a missing corner.

    Args:
        lines: Lines of the file.

    Raises:
        ValueError: If a face refers to a missing corner, or a corner does not have three finite coordinates.
    """
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    furthest = [0, 0, 0]
    for line in lines:
        key, *words = line.split() or [b""]
        if key in counts:
            counts[key] += 1
            if key == b"v" and not (len(words) >= 3 and all(math.isfinite(float(word)) for word in words[:3])):
                raise ValueError(f"corner {counts[key]} is not at three finite numbers")
        elif key == b"f":
            for word in words:
                for index, number in enumerate(word.split(b"/")[:3]):
                    furthest[index] = max(furthest[index], abs(int(number or 0)))
    for name, count, most in zip(("v", "vt", "vn"), counts.values(), furthest):
        if most > count:
            raise ValueError(f"a face names '{name}' {most} of {count}")


def _is_binary_stl(path: str) -> bool:
    with open(path, "rb") as file:
        triangles = int.from_bytes(file.read(84)[80:], "little")
    size = os.path.getsize(path)
    return size > 84 and size == 84 + 50 * triangles  # a header, and 50 bytes for each triangle


def soft_mesh_problems(path: str) -> list[str]:
    """Returns a message for each error in the mesh file of a soft body. The file must exist."""
    status = os.stat(path)
    return list(_soft_mesh_problems(path, status.st_size, status.st_mtime_ns))


@lru_cache(maxsize=32)
def _soft_mesh_problems(path: str, size: int, changed_ns: int) -> list[str]:
    """Computes the result of `soft_mesh_problems`, cached so that unchanged files are not read again.

    Reading a file would delay the simulation thread.
    """
    kind = Path(path).suffix.lower()
    if kind not in SOFT_MESH_FORMATS:
        return [f"expected one of {', '.join(SOFT_MESH_FORMATS)}, got {path}"]
    try:
        lines = [line.split() for line in read_file(path).decode().splitlines()]
        return [] if (_check_soft_vtk if kind == ".vtk" else _check_soft_obj)(lines) else [f"{path} is empty"]
    except UnicodeDecodeError:
        return [f"{path} is not text"]
    except (ValueError, IndexError, StopIteration) as error:
        return [f"{path} is no mesh that PyBullet can simulate: {str(error) or 'it ends too early'}"]


def _check_soft_obj(lines: list[list[str]]) -> bool:
    """Returns whether the mesh has faces; raises ValueError if a number is invalid or a corner does not exist."""
    corners = sum(1 for words in lines if words[:1] == ["v"] and _finite(words[1:4]))
    faces = [words[1:] for words in lines if words[:1] == ["f"]]
    for number in (int(corner.split("/")[0]) for face in faces for corner in face):
        if not 1 <= abs(number) <= corners:
            raise ValueError(f"a face names corner {number} of {corners}")
    return bool(faces)


def _check_soft_vtk(lines: list[list[str]]) -> bool:
    """Returns whether the mesh has tetrahedra; raises ValueError if a number is invalid or a corner does not exist."""
    rest = iter(lines)
    points = int(_after(rest, "POINTS")[1])
    for number in range(points):
        if not _finite(next(rest)):
            raise ValueError(f"point {number} is not three numbers on a line")
    cells = int(_after(rest, "CELLS")[1])
    for number in range(cells):
        corners = [int(word) for word in next(rest)]
        if len(corners) != 5 or corners[0] != 4 or not all(0 <= corner < points for corner in corners[1:]):
            raise ValueError(f"cell {number} is not a tetrahedron of the {points} points on a line: {corners}")
    return cells > 0


def _after(lines: Iterator[list[str]], word: str) -> list[str]:
    for words in lines:
        if words[:1] == [word]:
            return words
    raise ValueError(f"it has no {word}")


def _finite(words: list[str]) -> bool:
    return len(words) == 3 and all(math.isfinite(float(word)) for word in words)
