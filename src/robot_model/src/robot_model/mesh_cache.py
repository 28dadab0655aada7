"""Cache of files computed from meshes, in the user's cache folder; folder names contain a hash of the mesh files."""

import errno
import hashlib
import io
import os
import tempfile
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import shortened

MAX_FILE_BYTES = 1_000_000_000
"""Largest length of a file [bytes]."""
MAX_FILES = 100
"""Largest number of files that belong to one mesh: the mesh file, materials and textures."""


def cache_folder() -> Path:
    """Returns the user's cache folder for meshes, which may not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "rpbi" / "meshes"


def content_hash(file: str, *parameters: object) -> str:
    """Returns a hash of all data that a result computed from a mesh depends on.

    These data are the mesh file, the materials and textures that the mesh file names, PyBullet's version, and
    `parameters`. Missing files are ignored.

    Raises:
        OSError: If a material or texture exists but cannot be read as an ordinary file, or if there are more than
            `MAX_FILES` files.
    """
    digest = hashlib.blake2b(f"{parameters} {_pybullet_version()}".encode(), digest_size=16)
    waiting, seen = [Path(file)], set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        if len(seen) > MAX_FILES:
            raise OSError(errno.EMFILE, f"names more than {MAX_FILES} files")
        try:
            data = read_file(path, MAX_FILE_BYTES)
        except OSError as error:
            if len(seen) > 1 and os.path.exists(path):  # missing files are ignored
                raise OSError(error.errno, f"names '{shortened(path.name)}', which {error.strerror}") from None
            continue
        digest.update(f"{path.suffix.lower()} {len(data)} ".encode() + data)
        if path.suffix.lower() in (".obj", ".mtl"):
            waiting += [path.parent / name for _, name in files_named_in(data)]
    return digest.hexdigest()


def _pybullet_version() -> str:
    try:
        return version("pybullet")
    except PackageNotFoundError:
        return ""


def files_named_in(data: bytes) -> Iterator[tuple[bytes, str]]:
    """Yields the lines of an OBJ or MTL file that name a file (`mtllib`, `map_...`), each with the file name."""
    for line in io.BytesIO(data):
        words = line.split(None, 1)
        if len(words) == 2 and (words[0] == b"mtllib" or words[0].startswith(b"map_")) and b"\0" not in line:
            yield line, os.fsdecode(words[1].rstrip())


def cached(name: str, make: Callable[[Path], None]) -> Path:
    """Makes a folder in the cache if it does not exist, and returns its path.

    If several processes make the same folder at the same time, the first result is kept.

    Args:
        name: Name of the folder, which should contain a hash of all data that the content depends on.
        make: Function that writes the content into an empty folder.

    Raises:
        OSError: If the cache cannot be written.
    """
    folder = cache_folder() / name
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{name}-") as parent:
            made = Path(parent) / "made"
            made.mkdir()
            make(made)
            try:
                made.rename(folder)
            except OSError:
                if not folder.is_dir():
                    raise
    return folder
