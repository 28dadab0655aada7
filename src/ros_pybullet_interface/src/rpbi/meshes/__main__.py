"""Loads meshes as a test, in a separate process: `python -m rpbi.meshes FD USE FILE [USE FILE ...]`.

USE is a value of `trial.Use`. The process writes one line per mesh to the file descriptor FD. The line is empty, or
holds the reason why PyBullet cannot load the mesh. A broken mesh may crash this process, but not its parent process.
"""

import ctypes
import io
import math
import os
import struct
import sys
import tempfile
from typing import IO
from xml.sax.saxutils import quoteattr

import pybullet

from custom_ros_tools.config import read_file

from .checks import check_obj
from .trial import MAX_CPU_S, Use, limit_resources

FOUND_NOTHING = b"cannot extract anything useful"
"""Text that PyBullet prints when it ignores a mesh. For a visual mesh, this text is the only sign."""


def main() -> None:
    """Loads all meshes that the command line names, and reports the result for each mesh."""
    limit_resources(MAX_CPU_S)
    report, *meshes = sys.argv[1:]
    said = tempfile.TemporaryFile()
    os.dup2(said.fileno(), 1)
    pybullet.connect(pybullet.DIRECT)
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD)
    for use, file in zip(meshes[::2], meshes[1::2], strict=True):
        try:
            _check_numbers(file)
            _USES[Use(use)](file)
            message = ""
        except (pybullet.error, MemoryError) as error:
            message = str(error) or "out of memory"
        if _has_printed(said, FOUND_NOTHING):
            message = "it reads nothing from it"
        os.write(int(report), " ".join(message.split()).encode() + b"\n")


def _check_numbers(file: str) -> None:
    """Refuses STL files with non-finite numbers, and invalid OBJ files, by raising pybullet.error.

    Such files crash PyBullet only sometimes, so loading a file is not a sufficient test.
    """
    if file.lower().endswith(".obj"):
        try:
            check_obj(io.BytesIO(read_file(file)))
        except ValueError as error:
            raise pybullet.error(str(error)) from None
    if file.lower().endswith(".stl"):
        triangles = struct.iter_unpack("<12fH", read_file(file)[84:])
        if not all(math.isfinite(sum(numbers)) for numbers in triangles):
            raise pybullet.error("it has numbers that are not finite")


def _has_printed(said: IO[bytes], words: bytes) -> bool:
    """Returns whether PyBullet's C code has printed certain words since the last call.

    Args:
        said: File that receives standard output.
        words: The words.
    """
    ctypes.CDLL(None).fflush(None)
    found = words in os.pread(said.fileno(), 1 << 20, 0)
    os.ftruncate(said.fileno(), 0)
    os.lseek(said.fileno(), 0, os.SEEK_SET)
    return found


def _load_visual(file: str) -> None:
    shape = pybullet.createVisualShape(pybullet.GEOM_MESH, fileName=file)
    _remove(pybullet.createMultiBody(baseVisualShapeIndex=shape))


def _load_collision(file: str) -> None:
    for flags in (0, pybullet.GEOM_FORCE_CONCAVE_TRIMESH):
        shape = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=file, flags=flags)
        _remove(pybullet.createMultiBody(baseMass=0 if flags else 1, baseCollisionShapeIndex=shape))


def _load_height_field(file: str) -> None:
    shape = pybullet.createCollisionShape(pybullet.GEOM_HEIGHTFIELD, fileName=file)
    _remove(pybullet.createMultiBody(baseCollisionShapeIndex=shape))


def _load_soft(file: str) -> None:
    _remove(pybullet.loadSoftBody(file, useMassSpring=1))


def _load_urdf_visual(file: str) -> None:
    body_id = _load_link(f"<visual>{_geometry(file)}</visual>", True)
    if not pybullet.getVisualShapeData(body_id):
        raise pybullet.error("PyBullet leaves it out")
    _remove(body_id)


def _load_urdf_collision(file: str) -> None:
    for concave, is_fixed in (("no", False), ("no", True), ("yes", False), ("yes", True)):
        body_id = _load_link(f"<collision concave='{concave}'>{_geometry(file)}</collision>", is_fixed)
        if not pybullet.getCollisionShapeData(body_id, -1):
            raise pybullet.error("PyBullet leaves it out")
        _remove(body_id)


def _geometry(file: str) -> str:
    return f"<geometry><mesh filename={quoteattr(file)}/></geometry>"


def _load_link(parts: str, is_fixed: bool) -> int:
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as urdf:
        urdf.write(f"<robot name='trial'><link name='link'>{parts}</link></robot>")
        urdf.flush()
        return int(pybullet.loadURDF(urdf.name, useFixedBase=is_fixed))


def _remove(body_id: int) -> None:
    if body_id < 0:
        raise pybullet.error("PyBullet returns no body")
    pybullet.stepSimulation()
    pybullet.removeBody(body_id)


_USES = {
    Use.VISUAL: _load_visual,
    Use.COLLISION: _load_collision,
    Use.HEIGHT_FIELD: _load_height_field,
    Use.SOFT: _load_soft,
    Use.URDF_VISUAL: _load_urdf_visual,
    Use.URDF_COLLISION: _load_urdf_collision,
}

if __name__ == "__main__":
    main()
