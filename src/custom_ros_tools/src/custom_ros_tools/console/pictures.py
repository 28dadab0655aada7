"""The command `pictures`."""

import importlib
import sys
from typing import Annotated

from .argument import Argument, UsageError
from .modules import workspace


def pictures(*names: Annotated[str, Argument("[NAME ...]", offers="pictures")]) -> int:
    """Draws the pictures of the pages again, and writes them to docs/images.

    Each picture shows the code as it is: its script starts the example or simulates the world that the page names. The
    pictures of RViz and of windows are taken on a virtual screen.

    Args:
        NAME: picture to draw, such as demo or teleop; by default all, which takes some minutes
    """
    sys.path[:0] = [str(workspace() / "dev/pictures"), str(workspace() / "dev/benchmarks")]
    drawing = importlib.import_module("draw")
    for name in names:
        if not drawing.file_of(name):
            raise UsageError(f"there is no picture '{name}'; there are {', '.join(drawing.PICTURES)}")
    return int(drawing.draw(names))
