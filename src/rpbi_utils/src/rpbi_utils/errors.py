"""What can go wrong with bags and recordings; every one of them is an `InterfaceError`."""

from __future__ import annotations

from pathlib import Path

from custom_ros_tools.errors import InterfaceError


class BagError(InterfaceError):
    """A bag cannot be read, or what is in it cannot be written as asked.

    Args:
        path: The bag.
        message: What is wrong, and what to do about it.
    """

    def __init__(self, path: Path, message: str) -> None:
        self.path = path
        self.message = message
        super().__init__(path, message)

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


class RecordingError(BagError):
    """A recording of a bag could not be started, or is not complete."""

    def __str__(self) -> str:
        return f"recording {super().__str__()}"
