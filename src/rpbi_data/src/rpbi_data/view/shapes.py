"""Draws the visible shapes of bodies with viser, for pages of episodes and for the view of a running world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rpbi.bodies.visual_shapes import BodyShape, ShapeKind

from .scene import TriangleMesh


def add_shape(api: Any, name: str, shape: BodyShape, meshes: Mapping[BodyShape, TriangleMesh]) -> Any:
    """Adds a shape to a scene of viser, and returns viser's handle; returns None if the shape's mesh is missing.

    Args:
        api: The scene.
        name: Name of the shape below the node of its link, such as `/box/base/0`.
        shape: The shape.
        meshes: Meshes, indexed by shape.
    """
    x, y, z, w = shape.pose_in_link.quat_xyzw
    size = shape.size
    *rgb, alpha = shape.rgba
    common: dict[str, Any] = {
        "color": tuple(round(255 * each) for each in rgb),
        "opacity": None if alpha >= 1.0 else alpha,
        "position": shape.pose_in_link.position,
        "wxyz": (w, x, y, z),
    }
    if shape.kind is ShapeKind.BOX:
        return api.add_box(name, dimensions=size, **common)
    if shape.kind is ShapeKind.SPHERE:
        return api.add_icosphere(name, radius=size[0] / 2, **common)
    if shape.kind is ShapeKind.CYLINDER:
        return api.add_cylinder(name, radius=size[0] / 2, height=size[2], **common)
    if shape in meshes:
        return api.add_mesh_simple(name, *meshes[shape], side="double", **common)
    return None
