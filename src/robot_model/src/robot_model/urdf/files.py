"""Files of URDFs: search for the files that a URDF names, and temporary files for descriptions without a file."""

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
    """Returns a folder for this process's rewritten files, which is removed when the process ends."""
    return Path(temporary_folder("urdf").name)


def write_description(text: str) -> str:
    """Writes a robot description without a file, such as that of the parameter server, into a temporary file.

    Returns:
        The file, which lasts as long as the process.
    """
    path = _folder() / f"robot_description-{hashlib.sha256(text.encode()).hexdigest()[:12]}.urdf"
    path.write_text(text, encoding="utf-8")
    return str(path)


def is_temporary(path: str) -> bool:
    """Returns whether a file is one of this module's temporary files."""
    return Path(path).parent == _folder()


def found_by_ros(mesh: str, source: Path) -> str | Path:
    """Returns an address by which ROS finds the mesh or texture `mesh` of the URDF file `source`.

    Returns:
        A file for a relative path, or for a package that is unknown or lacks it; otherwise the address in the URDF.

    Raises:
        ConfigError: If it belongs to an unknown package and is not near the URDF.
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
    """Returns the path of the mesh `name` in the URDF file `source`: in its package, or where PyBullet searches.

    Raises:
        ConfigError: If its package is unknown. OSError: If the mesh does not exist.
    """
    if name.startswith(PACKAGE):
        return mesh_file(name, source)
    found = beside_or_above(name.removeprefix("model://"), source)
    if found is None:
        looked = "searched the folder of the URDF and all folders above"
        raise FileNotFoundError(f"no such mesh: {shortened(name)} ({looked})")
    return found


def mesh_file(mesh: str, source: Path) -> Path:
    """Returns the file of the mesh `mesh` in the URDF file `source`.

    Raises:
        ConfigError: If it belongs to an unknown package or does not exist.
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
    """Returns the path at which PyBullet finds a file that a URDF names: in its folder or a folder above."""
    files = (folder / name for folder in source.absolute().parents)
    return next((file for file in files if file.is_file()), None)


def _with_two_slashes(mesh: str) -> str:
    """Returns a mesh path of a URDF with `package://PACKAGE` for `package:///PACKAGE`, which some URDFs have."""
    return f"{PACKAGE}{mesh.removeprefix(PACKAGE).lstrip('/')}" if mesh.startswith(PACKAGE) else mesh


def _near(mesh: str, source: Path) -> Path | None:
    """Returns the file of a `package://` mesh that no package has, but the URDF's folder or one above it has.

    PyBullet searches these folders, and its own robots rely on that. It also finds the meshes of a package that is
    hidden by another of the same name.
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
