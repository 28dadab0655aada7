"""Replaces files atomically, and makes temporary folders that are removed after the end of the process."""

import atexit
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_PREFIX = "rpbi-"
_NAME = re.compile(rf"{_PREFIX}[a-z]+-(?P<process>\d+)-\w+")


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Replaces a file atomically at the end of a context.

    Yields a temporary path to write to: the same file name in a hidden folder next to the file, which patterns such as
    `*.csv` do not match. At the end of the context, the written file replaces the old file. If the context raises an
    error, the written file is removed, and the old file does not change. If `path` or the hidden folder is a symbolic
    link, the link is replaced, not followed.
    """
    folder = path.with_name(f".{path.name}.part")
    if folder.is_symlink():
        folder.unlink()
    folder.mkdir(exist_ok=True)
    (folder / path.name).unlink(missing_ok=True)
    try:
        yield folder / path.name
        (folder / path.name).replace(path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def temporary_folder(kind: str) -> tempfile.TemporaryDirectory[str]:
    """Makes a temporary folder, which exists until its method `cleanup` is called or the process ends.

    If a process is killed, its folder is removed when another process calls this function.

    Args:
        kind: Word for the content in lower-case letters, which becomes part of the folder's name.
    """
    _remove_left_behind()
    folder = tempfile.TemporaryDirectory(prefix=f"{_PREFIX}{kind}-{os.getpid()}-")
    atexit.register(folder.cleanup)
    return folder


def _remove_left_behind() -> None:
    """Removes temporary folders of this user whose processes have ended."""
    with suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
            match = _NAME.fullmatch(folder.name)
            if match and not _is_alive(int(match["process"])) and folder.lstat().st_uid == os.getuid():
                shutil.rmtree(folder, ignore_errors=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True
