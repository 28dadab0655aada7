"""A part of the controls window."""

from collections.abc import Callable
from typing import Any

from PyQt5.QtCore import QEvent, QObject, Qt
from PyQt5.QtWidgets import QGroupBox, QScrollArea, QWidget

from rpbi_utils.controls.requests import LIMIT_S, BackgroundRequests, RequestResult
from rpbi_utils.plain_text import plain_tip

from .link import SimulatorLink, SimulatorSnapshot

Then = Callable[[RequestResult], None]
Condition = Callable[[SimulatorSnapshot], bool]


class Panel(QGroupBox):
    """A part of the window, with a frame and a title.

    Args:
        title: Its title.
        link: The simulator.
        requests: Runs what may take time.
    """

    def __init__(self, title: str, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__(title)
        self.link, self._requests = link, requests
        self._needed: dict[QWidget, tuple[str, Condition]] = {}

    def ask(self, name: str, function: Callable[[], Any], then: Then | None = None, limit_s: float = LIMIT_S) -> None:
        """Runs a function in the background; shows its result, and calls `then` with it in the window's thread."""
        self._requests.ask(name, function, then, limit_s)

    def require(self, service: str, *widgets: QWidget, when: Condition = lambda _: True) -> None:
        """Disables widgets while a service is missing, or a condition is not met."""
        self._needed.update(dict.fromkeys(widgets, (service, when)))

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        """Shows the state of the simulator; called ten times a second and after each request."""
        for widget, (service, is_met) in self._needed.items():
            widget.setEnabled(snapshot.has(service) and is_met(snapshot))


class ScrolledDown(QScrollArea):
    """A widget with a bar to scroll if there is too little height; it has the width that it needs, as it changes.

    Args:
        content: The widget.
    """

    def __init__(self, content: QWidget) -> None:
        super().__init__()
        self.setWidget(content)
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Receives all events of the content."""
        if event.type() == QEvent.Type.LayoutRequest:
            bar = self.verticalScrollBar()
            self.setMinimumWidth(self.widget().minimumSizeHint().width() + bar.width() * bar.isVisible())
        return bool(super().eventFilter(watched, event))


def named(widget: QWidget, name: str, tip: str = "") -> Any:
    """Returns a widget, with a name by which programs find it, and a tip."""
    widget.setObjectName(name)
    widget.setToolTip(plain_tip(tip))
    return widget
