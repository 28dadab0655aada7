"""Meshes that PyBullet would not refuse but crash on, and take the whole process with it."""

from __future__ import annotations

import struct
from pathlib import Path

from ..pybullet_models import CreateCollisionShape, CreateVisualShape

_STL_HEADER = struct.Struct("<80xI")
_STL_TRIANGLE_SIZE = 50  # bytes


def mesh_faults(shape: CreateVisualShape | CreateCollisionShape) -> list[tuple[str, str]]:
    """Returns key and message of each fault in what a shape says about its mesh."""
    faults = []
    if shape.fileName is not None and shape.fileName.lower().endswith(".stl") and not _is_binary_stl(shape.fileName):
        faults.append(("fileName", f"expected a whole binary STL file, got another kind or a part: {shape.fileName}"))
    if shape.indices is not None:
        corners = len(shape.vertices or ())
        if len(shape.indices) % 3:
            faults.append(("indices", f"expected three for each triangle, got {len(shape.indices)} of them"))
        if any(index >= corners for index in shape.indices):
            faults.append(("indices", f"expected numbers of the {corners} vertices, got {max(shape.indices)}"))
    return faults


def _is_binary_stl(path: str) -> bool:
    data = Path(path).read_bytes()
    if len(data) <= _STL_HEADER.size:
        return False
    (triangles,) = _STL_HEADER.unpack_from(data)
    return len(data) == _STL_HEADER.size + triangles * _STL_TRIANGLE_SIZE
