"""Errors of bags and recordings; each is an `InterfaceError`."""

from dataclasses import dataclass
from pathlib import Path

from custom_ros_tools.errors import InterfaceError


@dataclass(eq=False)
class BagError(InterfaceError):
    """A bag cannot be read, or its content cannot be written as requested; the message includes a remedy."""

    path: Path
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


class RecordingError(BagError):
    """A recording of a bag could not be started, or is not complete."""

    def __str__(self) -> str:
        return f"recording {super().__str__()}"
