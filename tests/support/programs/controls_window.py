"""A node's window on a virtual screen: its widgets are observed, mouse and keys are real.

Run as a program, it is the node, and writes what its widgets show into the file that WIDGETS names. It is the controls
window, or that of the module in WINDOW.
"""

from __future__ import annotations

import json
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

FILE, MODULE = "WIDGETS", "WINDOW"
PERIOD_MS = 30


class Widget(NamedTuple):
    """A widget as it was a moment ago.

    Attributes:
        x: Column of its middle on the screen [px].
        y: Row of its middle [px].
        width: Its width [px].
        is_enabled: Whether it can be used.
        text: Its text or value.
    """

    x: int
    y: int
    width: int
    is_enabled: bool
    text: str


def widgets(path: Path) -> dict[str, Widget]:
    """Returns the visible widgets by name."""
    try:
        return {name: Widget(*values) for name, values in json.loads(path.read_text()).items()}
    except FileNotFoundError:
        return {}


def _text(widget: Any) -> str:
    if hasattr(widget, "rowCount"):
        rows = range(widget.rowCount())
        return "\n".join(" ".join(widget.item(row, column).text() for column in range(2)) for row in rows)
    pixmap = widget.pixmap() if hasattr(widget, "pixmap") else None
    if pixmap is not None and not pixmap.isNull():
        return f"{pixmap.width()} x {pixmap.height()}"
    read = next((getattr(widget, name) for name in ("text", "currentText", "value") if hasattr(widget, name)), str)
    return str(read())


def _observe(window: Any, path: Path) -> Any:
    from PyQt5.QtCore import QTimer
    from PyQt5.QtWidgets import QWidget

    def write() -> None:
        found = {}
        for widget in window.findChildren(QWidget):
            name = widget.objectName()
            if name and not name.startswith("qt_") and widget.isVisible():
                middle = widget.mapToGlobal(widget.rect().center())
                found[name] = (middle.x(), middle.y(), widget.width(), widget.isEnabled(), _text(widget))
                for row in range(widget.rowCount() if hasattr(widget, "rowCount") else 0):
                    item = widget.item(row, 0)
                    middle = widget.viewport().mapToGlobal(widget.visualItemRect(item).center())
                    found[f"{name}/{item.text()}"] = (middle.x(), middle.y(), 1, widget.isEnabled(), item.text())
        path.with_suffix(".new").write_text(json.dumps(found))
        path.with_suffix(".new").rename(path)

    timer = QTimer(window)
    timer.timeout.connect(write)
    timer.start(PERIOD_MS)
    return timer


def main() -> None:
    """Runs the node as its own script does."""
    node: Any = import_module(os.environ.get(MODULE, "rpbi_utils.controls.ros.node"))
    window_node: Any = import_module("rpbi_utils.window_node")
    show = window_node._show

    def show_observed(opened: Any) -> None:
        timer = _observe(opened[-1], Path(os.environ[FILE]))
        show(opened)
        timer.stop()

    window_node._show = show_observed
    node.main()


if __name__ == "__main__":
    from custom_ros_tools.program import run

    run(f"{Path(__file__).stem}:main")
    sys.exit()
