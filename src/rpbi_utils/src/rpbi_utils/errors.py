"""What can go wrong with bags and recordings; every one of them is an `InterfaceError`."""

from dataclasses import dataclass
from pathlib import Path

from custom_ros_tools.errors import InterfaceError


@dataclass(eq=False)
class BagError(InterfaceError):
    """A bag cannot be read, or what is in it cannot be written as asked; the message says what to do about it."""

    path: Path
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


class RecordingError(BagError):
    """A recording of a bag could not be started, or is not complete."""

    def __str__(self) -> str:
        return f"recording {super().__str__()}"
