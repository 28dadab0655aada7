"""Temporary folders of a process: removed when it ends or, if it was killed, when the next process starts."""

import atexit
import os
import re
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

_PREFIX = "rpbi-"
_NAME = re.compile(rf"{_PREFIX}[a-z]+-(?P<process>\d+)-\w+")


def temporary_folder(kind: str) -> tempfile.TemporaryDirectory[str]:
    """Returns a new folder of this process, which lasts until it is cleaned up or the process ends.

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
