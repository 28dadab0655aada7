"""URDF files as PyBullet and ROS can read them."""

import hashlib
import re
from functools import lru_cache
from pathlib import Path

from custom_ros_tools.config import read_file, replace_package
from custom_ros_tools.errors import ConfigError, Problem
from rpbi.meshes.copies import with_textures_that_exist
from rpbi.temporary import temporary_folder

_FILENAME = re.compile(
    r"""(?P<before><(?:mesh|texture)\b[^>]*?\bfilename\s*=\s*)(?P<quote>["'])(?P<path>.*?)(?P=quote)"""
)
NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not allow (https://www.w3.org/TR/xml/#charsets); PyBullet does not mind them."""
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
PACKAGE = "package://"


@lru_cache(maxsize=1)
def _folder() -> Path:
    """Returns a folder for this process's rewritten files; it goes when the process ends."""
    return Path(temporary_folder("urdf").name)


def _read(path: Path) -> str:
    """Returns the text of a URDF file without its comments, and without characters that XML does not allow."""
    return COMMENT.sub("", NOT_XML.sub("", read_file(path).decode()))


def resolve_meshes(path: str) -> str:
    """Makes the meshes of a URDF file loadable by PyBullet, which knows nothing of ROS packages.

    Returns:
        The file itself if it needs nothing, else that of a copy in which every `package://` path, and with them
        every relative one, is absolute.

    Raises:
        ConfigError: If a mesh belongs to an unknown package or does not exist.
    """
    source = Path(path)
    text = _read(source)
    if PACKAGE not in text:
        return path
    problems: list[Problem] = []

    def absolute(match: re.Match[str]) -> str:
        try:
            resolved = mesh_file(match["path"], source)
        except ConfigError as error:
            problems.extend(error.problems)
            return match[0]
        return f"{match['before']}{match['quote']}{resolved}{match['quote']}"

    resolved_text = _FILENAME.sub(absolute, text)
    if problems:
        raise ConfigError(problems)
    return _write(source.stem, resolved_text)


def write_description(text: str) -> str:
    """Writes a robot description that has no file, such as that of the parameter server, into one of its own.

    Returns:
        The file, which lasts as long as the process.
    """
    return _write("robot_description", text)


def is_temporary(path: str) -> bool:
    """Returns whether a file is one of this module's, which go when the process ends."""
    return Path(path).parent == _folder()


def description_for_ros(path: str) -> str:
    """Returns a URDF file as ROS wants it, which does not know where the file is.

    Returns:
        Its text, with relative mesh paths as `file://` addresses; paths of ROS packages stay. Meshes whose textures
        are missing are copies without them.

    Raises:
        ConfigError: If a mesh belongs to an unknown package.
    """
    source = Path(path)

    def address(match: re.Match[str]) -> str:
        mesh = _with_two_slashes(match["path"])
        if "://" not in mesh:
            file: Path | None = source.parent / mesh
        elif _is_of_unknown_package(mesh):
            file = mesh_file(mesh, source)
        else:
            file = None if _is_in_its_package(mesh) else _near(mesh, source)
        said = mesh if file is None else f"file://{with_textures_that_exist(file.resolve())}"
        return f"{match['before']}{match['quote']}{said}{match['quote']}"

    return _FILENAME.sub(address, _read(source))


def mesh_file(mesh: str, source: Path) -> Path:
    """Returns the file of a mesh, of which the URDF file `source` says `mesh`.

    Raises:
        ConfigError: If it belongs to an unknown package or does not exist.
    """
    mesh = _with_two_slashes(mesh)
    try:
        file = source.parent / replace_package(mesh)
        problems = [] if file.is_file() else [Problem(str(source), mesh, f"no such file: {file}")]
    except ConfigError as error:
        problems = [Problem(str(source), mesh, problem.message) for problem in error.problems]
    if not problems:
        return file
    found = _near(mesh, source)
    if found is None:
        raise ConfigError(problems)
    return found


def beside_or_above(name: str, source: Path) -> Path | None:
    """Returns where PyBullet finds a file that a URDF names: beside it or in a folder above."""
    files = (folder / name for folder in source.absolute().parents)
    return next((file for file in files if file.is_file()), None)


def _with_two_slashes(mesh: str) -> str:
    """Returns what a URDF says of a mesh with `package://PACKAGE` for `package:///PACKAGE`, which some URDFs have."""
    return f"{PACKAGE}{mesh.removeprefix(PACKAGE).lstrip('/')}" if mesh.startswith(PACKAGE) else mesh


def _near(mesh: str, source: Path) -> Path | None:
    """Returns the file of a `package://` mesh that no package has, but a folder beside the URDF or above it.

    PyBullet looks there, its own robots use that. And where the package of a URDF is hidden by another of its name, its
    meshes are there still.
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


def _write(stem: str, text: str) -> str:
    path = _folder() / f"{stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.urdf"
    path.write_text(text, encoding="utf-8")
    return str(path)
