"""Decomposes concave meshes into convex parts with PyBullet's V-HACD.

V-HACD takes seconds and does not check its input. V-HACD therefore runs in a separate process, `python -m
rpbi.meshes.decomposition MESH PARTS PARAMETERS`. The parts are cached; the key is a hash of the mesh's content and the
parameters.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pybullet

from custom_ros_tools.child_process import python_module
from custom_ros_tools.files import temporary_folder
from robot_model.mesh_cache import cached, content_hash

from .trial import limit_resources
from .triangles import read_triangles

MAX_CPU_S = 600
"""Processor time [s] after which the process of V-HACD is ended."""
MAX_WALL_S = 900.0
"""Wall time [s] after which the process of V-HACD is ended."""
_PARTS = "parts.obj"
_without_cache: dict[str, Path] = {}
"""Temporary folders with parts of meshes, used if the cache cannot be written; keyed by the name of the cache entry."""


def convex_parts(mesh: str, parameters: Mapping[str, float]) -> str:
    """Decomposes a mesh, and returns the path of an OBJ file in which each convex part is an object.

    Args:
        mesh: An OBJ or STL file.
        parameters: Arguments of PyBullet's `vhacd`.

    Raises:
        ValueError: If the mesh cannot be read, or V-HACD fails.
    """
    ordered = dict(sorted(parameters.items()))
    name = f"convex-{content_hash(mesh, ordered)}"
    if name in _without_cache:
        return str(_without_cache[name] / _PARTS)
    try:
        return str(cached(name, lambda folder: _decompose(mesh, ordered, folder)) / _PARTS)
    except OSError:
        folder = Path(temporary_folder("parts").name)
        try:
            _decompose(mesh, ordered, folder)
        except OSError as error:
            raise ValueError(f"V-HACD of {mesh}: {error}") from None
        _without_cache[name] = folder
        return str(folder / _PARTS)


def _decompose(mesh: str, parameters: Mapping[str, float], folder: Path) -> None:
    """Runs V-HACD for a mesh in a child process, and writes the parts into a folder."""
    source, parts = folder / "mesh.obj", folder / _PARTS
    corners = [corner for part in read_triangles(mesh) for triangle in part.tolist() for corner in triangle]
    numbers = {corner: number for number, corner in enumerate(dict.fromkeys(map(tuple, corners)), start=1)}
    of_corners = [str(numbers[tuple(corner)]) for corner in corners]
    with open(source, "w", encoding="utf-8") as file:
        file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in numbers)
        file.writelines(f"f {' '.join(of_corners[at : at + 3])}\n" for at in range(0, len(of_corners), 3))
    command = python_module(__name__, str(source), str(parts), json.dumps(parameters))
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=MAX_WALL_S,
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"V-HACD takes more than {MAX_WALL_S:g} s for {mesh}; lower `resolution`") from None
    source.unlink()
    if done.returncode or not parts.is_file() or not read_triangles(str(parts)):
        raise ValueError(f"V-HACD makes no parts of {mesh} (exit code {done.returncode})")


def main() -> None:
    """Runs V-HACD on the files that the command line names."""
    limit_resources(MAX_CPU_S)
    source, parts, parameters = sys.argv[1:]
    pybullet.vhacd(source, parts, "/dev/null", **json.loads(parameters))


if __name__ == "__main__":
    main()
