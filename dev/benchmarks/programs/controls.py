"""Opens the controls window and prints where its widgets are, and when buttons become usable. Arguments: the slider."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from PyQt5.QtCore import QEvent, QObject, QPoint, QTimer
from PyQt5.QtWidgets import QApplication, QPushButton, QSlider, QStyle, QStyleOptionSlider, QWidget

from custom_ros_tools.program import run
from rpbi_utils.controls.ros import node

BUTTONS = ("start", "stop", "send")
LOOK_MS, SETTLE_MS = 100, 1000


class Observer(QObject):
    """Prints the name of a button, whether it can be used, and since when."""

    def eventFilter(self, button: QWidget, event: QEvent) -> bool:
        """Notes an event of a button."""
        if event.type() == QEvent.EnabledChange:
            print(button.objectName(), int(button.isEnabled()), time.monotonic(), flush=True)
        return False


def main() -> None:
    """Runs the program as `rosrun rpbi_utils rpbi_controls_node.py` does."""
    slider = sys.argv.pop(1)
    show = node._show

    def show_observed(opened: tuple[Any, Any, Any]) -> None:
        window, observer = opened[-1], Observer()
        timer = QTimer(window)

        def look() -> None:
            handle = window.findChild(QSlider, slider)
            buttons = [window.findChild(QPushButton, name) for name in BUTTONS]
            if handle is None or not handle.isVisible() or not buttons[1].isEnabled():
                return
            timer.stop()
            for button in buttons:
                button.installEventFilter(observer)
            QTimer.singleShot(SETTLE_MS, lambda: _print_places(handle, buttons))  # the layout is that of before

        timer.timeout.connect(look)
        timer.start(LOOK_MS)
        show(opened)

    node._show = show_observed
    node.main()


def _print_places(slider: QSlider, buttons: list[QPushButton]) -> None:
    """Prints the middles of buttons and of a slider's handle on the screen."""
    option = QStyleOptionSlider()
    slider.initStyleOption(option)
    style = QApplication.style()
    handle = style.subControlRect(QStyle.CC_Slider, option, QStyle.SC_SliderHandle, slider).center()
    places = {button.objectName(): _on_screen(button, button.rect().center()) for button in buttons}
    print(f"places: {json.dumps({**places, 'slider': _on_screen(slider, handle)})}", flush=True)


def _on_screen(widget: QWidget, point: QPoint) -> tuple[int, int]:
    middle = widget.mapToGlobal(point)
    return middle.x(), middle.y()


if __name__ == "__main__":
    run("controls:main")
