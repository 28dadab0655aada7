"""Finds the files that a URDF names, and writes robot descriptions without a file to temporary files."""

import hashlib
from functools import lru_cache
from pathlib import Path

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, Problem, shortened
from custom_ros_tools.files import temporary_folder
from robot_model.asset_files import resolve_package

PACKAGE = "package://"


@lru_cache(maxsize=1)
def _folder() -> Path:
    """Makes this process's temporary folder, which is removed when the process ends."""
    return Path(temporary_folder("urdf").name)


def write_description(text: str) -> str:
    """Writes a robot description, such as the text on the parameter server, to a temporary file.

    Returns:
        Path of the file, which exists until the process ends.
    """
    path = _folder() / f"robot_description-{hashlib.sha256(text.encode()).hexdigest()[:12]}.urdf"
    path.write_text(text, encoding="utf-8")
    return str(path)


def is_temporary(path: str) -> bool:
    """Returns whether a file was written by `write_description` in this process."""
    return Path(path).parent == _folder()


def found_by_ros(mesh: str, source: Path) -> str | Path:
    """Returns the address or path with which ROS can load a mesh or texture.

    Relative paths start at the folder of the URDF. If the ROS package is unknown or lacks the file, the URDF's folder
    and all folders above are searched.

    Args:
        mesh: File name of the mesh or texture, as written in the URDF.
        source: Path of the URDF.

    Returns:
        The unchanged address if ROS can resolve it, or a path.

    Raises:
        ConfigError: If the package is unknown, and the file is not in the URDF's folder or a folder above.
    """
    mesh = _with_two_slashes(mesh)
    if "://" not in mesh:
        file: Path | None = source.parent / mesh
    elif _is_of_unknown_package(mesh):
        file = mesh_file(mesh, source)
    else:
        file = None if _is_in_its_package(mesh) else _near(mesh, source)
    return mesh if file is None else file.resolve()


def found_mesh(name: str, source: Path) -> Path:
    """Finds a mesh in its ROS package, or, like PyBullet, in the URDF's folder and all folders above.

    Args:
        name: File name of the mesh, as written in the URDF.
        source: Path of the URDF.

    Raises:
        ConfigError: If a mesh with a `package://` path is not found.
        OSError: If a mesh with another path is not found.
    """
    if name.startswith(PACKAGE):
        return mesh_file(name, source)
    found = beside_or_above(name.removeprefix("model://"), source)
    if found is None:
        looked = "searched the folder of the URDF and all folders above"
        raise FileNotFoundError(f"no such mesh: {shortened(name)} ({looked})")
    return found


def mesh_file(mesh: str, source: Path) -> Path:
    """Finds a mesh in its ROS package, if its name begins with `package://`, or else relative to the URDF's folder.

    A `package://` mesh that its package lacks is searched for in the URDF's folder and all folders above.

    Args:
        mesh: File name of the mesh, as written in the URDF.
        source: Path of the URDF.

    Raises:
        ConfigError: If the mesh is not found.
    """
    mesh = _with_two_slashes(mesh)
    try:
        file = source.parent / resolve_package(mesh)
        problems = [] if file.is_file() else [Problem(str(source), mesh, f"no such file: {file}")]
    except ValueError as error:
        problems = [Problem(str(source), mesh, str(error))]
    if not problems:
        return file
    found = _near(mesh, source)
    if found is None:
        raise ConfigError(problems)
    return found


def beside_or_above(name: str, source: Path) -> Path | None:
    """Searches for a file like PyBullet: in the folder of the URDF `source`, then in all folders above.

    Returns:
        Path of the file; None if the file is not found.
    """
    files = (folder / name for folder in source.absolute().parents)
    return next((file for file in files if file.is_file()), None)


def _with_two_slashes(mesh: str) -> str:
    """Replaces `package:///PACKAGE`, which some URDFs have, by `package://PACKAGE`."""
    return f"{PACKAGE}{mesh.removeprefix(PACKAGE).lstrip('/')}" if mesh.startswith(PACKAGE) else mesh


def _near(mesh: str, source: Path) -> Path | None:
    """Searches for a `package://` mesh in the URDF's folder and all folders above, without using ROS packages.

    The robots in PyBullet's data rely on this search, which PyBullet also does. The search also finds meshes of a
    package that is hidden by another package with the same name.
    """
    return beside_or_above(mesh.removeprefix(PACKAGE), source.resolve()) if mesh.startswith(PACKAGE) else None


def _is_in_its_package(mesh: str) -> bool:
    return not mesh.startswith(PACKAGE) or Path(replace_package(mesh)).is_file()


def _is_of_unknown_package(mesh: str) -> bool:
    try:
        replace_package(mesh)
    except ConfigError:
        return mesh.startswith(PACKAGE)
    return False
