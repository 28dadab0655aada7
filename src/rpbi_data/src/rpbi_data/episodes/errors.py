"""Errors that concern episodes."""

import errno
from dataclasses import dataclass
from pathlib import Path

from custom_ros_tools.errors import InterfaceError

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Error numbers that mean that the disk is full, or a quota or file size is exceeded."""


@dataclass(eq=False)
class EpisodeError(InterfaceError):
    """An episode or a folder of episodes is invalid, or cannot be read or written."""

    path: Path
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"
