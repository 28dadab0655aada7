"""Files made from meshes, cached in the user's cache folder by a hash of their sources."""

import errno
import hashlib
import io
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import shortened

MAX_FILE_BYTES = 1_000_000_000
"""Length of a file."""
MAX_FILES = 100
"""Files that a mesh consists of, with its materials and textures."""


def cache_folder() -> Path:
    """Returns the user's cache folder for meshes, which may not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "rpbi" / "meshes"


def content_hash(file: str, *parameters: object) -> str:
    """Returns a hash of all files that PyBullet reads for a mesh, of PyBullet's version, and of further values.

    Raises:
        OSError: If one of its files is there, but is no ordinary file, or if it names too many.
    """
    digest = hashlib.blake2b(f"{parameters} {version('pybullet')}".encode(), digest_size=16)
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
            if len(seen) > 1 and os.path.exists(path):  # it may name what is not there
                raise OSError(error.errno, f"names '{shortened(path.name)}', which {error.strerror}") from None
            continue
        digest.update(f"{path.suffix.lower()} {len(data)} ".encode() + data)
        if path.suffix.lower() in (".obj", ".mtl"):
            waiting += [path.parent / name for _, name in _named(data)]
    return digest.hexdigest()


def _named(data: bytes) -> Iterator[tuple[bytes, str]]:
    """Yields the lines of an OBJ file, or of its materials, that name files, and the names."""
    for line in io.BytesIO(data):
        words = line.split(None, 1)
        if len(words) == 2 and (words[0] == b"mtllib" or words[0].startswith(b"map_")) and b"\0" not in line:
            yield line, os.fsdecode(words[1].rstrip())


def kept(name: str, make: Callable[[Path], None]) -> Path:
    """Returns a folder of the cache, created atomically; of several processes, the first one's result is kept.

    Args:
        name: Its name, with a hash of all that its content depends on.
        make: Fills an empty folder.

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


def with_textures_that_exist(mesh: Path) -> Path:
    """Returns an OBJ file whose materials name only existing textures; RViz reports missing ones as errors.

    Returns:
        The mesh itself, or a copy in the cache, without the lines that name what is missing.
    """
    try:
        data = read_file(mesh) if mesh.suffix.lower() == ".obj" else b""
        names = {name for _, name in _named(data) if Path(name).name == name and (mesh.parent / name).is_file()}
        materials = {name: read_file(mesh.parent / name) for name in names}
        textures = [(name, line, texture) for name, text in materials.items() for line, texture in _named(text)]
        missing = [(name, line) for name, line, texture in textures if not _texture_file(mesh, texture)]
        if not missing:
            return mesh
        for name, line in missing:
            materials[name] = materials[name].replace(line, b"\n")

        def make(folder: Path) -> None:
            for name, text in {mesh.name: data, **materials}.items():
                (folder / name).write_bytes(text)
            for texture in {file for *_, texture in textures if (file := _texture_file(mesh, texture))}:
                if Path(texture).name == texture:
                    shutil.copyfile(mesh.parent / texture, folder / texture)

        return kept(f"for-ros-{content_hash(str(mesh))}", make) / mesh.name
    except OSError:
        return mesh


def _texture_file(mesh: Path, texture: str) -> str:
    """Returns the file name of a texture, which may have options in front; empty if there is no such file."""
    return next((name for name in (texture, *texture.split()[-1:]) if (mesh.parent / name).is_file()), "")
