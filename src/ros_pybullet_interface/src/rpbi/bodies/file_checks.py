"""Checks the files of a configuration before PyBullet reads them, since faulty files can crash the process."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import pybullet

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.config.pybullet_models import (
    CreateCollisionShape,
    CreateVisualShape,
    LoadSoftBody,
    LoadURDF,
    PybulletModel,
)
from rpbi.meshes.checks import mesh_problems, soft_mesh_problems
from rpbi.meshes.decomposition import convex_parts
from rpbi.meshes.trial import Mesh, Use, faults_in
from rpbi.urdf.loading import urdf_problems

from .body_config import BodyConfig
from .shape_object import ConvexDecomposition

_PARTS: dict[str, type[PybulletModel]] = {
    "createVisualShape": CreateVisualShape,
    "createCollisionShape": CreateCollisionShape,
    "loadURDF": LoadURDF,
    "loadSoftBody": LoadSoftBody,
}


def check_files(config: BodyConfig) -> None:
    """Checks the meshes and the URDF of a body; results are cached, so the first check of a file takes longest.

    Raises:
        ConfigError: If a file cannot be loaded; the error lists all problems.
    """
    parts = {key: getattr(config, key) for key in type(config).model_fields}
    problems = [Problem(config.name, key, message) for key, message in file_problems(parts)]
    if problems:
        raise ConfigError(problems)


def parts_with_files(data: object, file: str, context: Mapping[str, Any]) -> dict[str, PybulletModel]:
    """Returns the sections of an object's YAML that may name files, such as `loadURDF`, indexed by key.

    Leaves out sections that are not valid.

    Args:
        data: Content of the object's YAML file.
        file: Name of the YAML file.
        context: Settings for resolving file names, as for `load_object`.
    """
    parts = {}
    for key, model in _PARTS.items():
        with suppress(ConfigError):
            if isinstance(data, Mapping) and key in data:
                parts[key] = model.parse(data[key], file, context)
    return parts


def file_problems(parts: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yields a key and a message for each fault in the files that an object's configuration names.

    Args:
        parts: Values of the object's configuration, such as a LoadURDF, indexed by key.
    """
    meshes: dict[Mesh, str] = {}
    for key, part in parts.items():
        if isinstance(part, (CreateVisualShape, CreateCollisionShape)):
            problems_of_mesh = [(f"{key}.{inner}", message) for inner, message in mesh_problems(part)]
            yield from problems_of_mesh
            if part.fileName is not None and not problems_of_mesh and (use := _use_of(part)) is not None:
                meshes[Mesh(use, part.fileName)] = f"{key}.fileName"
        elif isinstance(part, LoadURDF):
            for message in urdf_problems(part.fileName):
                yield f"{key}.fileName", message
        elif isinstance(part, LoadSoftBody):
            for inner in ("fileName", "simFileName"):
                file = getattr(part, inner)
                if file is not None:
                    problems = soft_mesh_problems(file)
                    yield from ((f"{key}.{inner}", message) for message in problems)
                    meshes |= {} if problems else {Mesh(Use.SOFT, file): f"{key}.{inner}"}
    faults = faults_in(meshes)
    for mesh, fault in faults.items():
        yield meshes[mesh], f"{fault}: {mesh.file}"
    shape, decomposition = parts.get("createCollisionShape"), parts.get("convexDecomposition")
    if not faults and isinstance(shape, CreateCollisionShape) and isinstance(decomposition, ConvexDecomposition):
        if problem := _decomposition_problem(shape, decomposition):
            yield "convexDecomposition", problem


def _decomposition_problem(shape: CreateCollisionShape, decomposition: ConvexDecomposition) -> str:
    """Divides a shape into convex parts; returns an error message, or an empty text after success."""
    if shape.shapeType != pybullet.GEOM_MESH or shape.fileName is None:
        return "expected a createCollisionShape of GEOM_MESH with a fileName"
    if (shape.flags or 0) & pybullet.GEOM_FORCE_CONCAVE_TRIMESH:
        return "with the flag GEOM_FORCE_CONCAVE_TRIMESH a mesh collides as it is; remove one of the two"
    try:
        convex_parts(shape.fileName, decomposition.model_dump())
    except ValueError as error:
        return str(error)
    return ""


def _use_of(shape: CreateVisualShape | CreateCollisionShape) -> Use | None:
    """Returns how PyBullet uses the file of a shape; None if PyBullet does not read the file."""
    if shape.shapeType == pybullet.GEOM_MESH:
        return Use.VISUAL if isinstance(shape, CreateVisualShape) else Use.COLLISION
    is_field = shape.shapeType == pybullet.GEOM_HEIGHTFIELD and isinstance(shape, CreateCollisionShape)
    return Use.HEIGHT_FIELD if is_field else None
