"""Files that are replaced as a whole, and temporary folders that are removed after their process has ended."""

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
    """Yields a path of the same name to write to, in a hidden folder next to the file; `*.csv` does not match it.

    At the end of the context, the written file replaces the former one. If the context fails, the written file is
    removed and the former one stays unchanged. Symbolic links at either path are removed first.
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
    """Returns a new folder of this process, which lasts until it is cleaned up or the process ends.

    The folder of a killed process is removed when the next process calls this function.

    Args:
        kind: Its content, in small letters, for people who look at the folder of temporary files.
    """
    _remove_left_behind()
    folder = tempfile.TemporaryDirectory(prefix=f"{_PREFIX}{kind}-{os.getpid()}-")
    atexit.register(folder.cleanup)
    return folder


def _remove_left_behind() -> None:
    """Removes the folders that ended processes of this user have left behind."""
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
