"""Base class of the controls window's panels, and helpers for their widgets."""

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
    """Base class of the panels. A panel is a box with a border and a title.

    Args:
        title: Title of the panel.
        link: Access to the running simulator.
        requests: Runs functions that may block.
    """

    def __init__(self, title: str, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__(title)
        self.link, self._requests = link, requests
        self._needed: dict[QWidget, tuple[str, Condition]] = {}

    def ask(self, name: str, function: Callable[[], Any], then: Then | None = None, limit_s: float = LIMIT_S) -> None:
        """Runs a function in the background. The window shows the result, and calls `then` with the result.

        If the function takes longer than `limit_s` [s], the result is an error.
        """
        self._requests.ask(name, function, then, limit_s)

    def require(self, service: str, *widgets: QWidget, when: Condition = lambda _: True) -> None:
        """Makes `refresh` disable widgets while a service is missing or the condition `when` is not met."""
        self._needed.update(dict.fromkeys(widgets, (service, when)))

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        """Shows the simulator's state. The window calls this method ten times a second and after each request."""
        for widget, (service, is_met) in self._needed.items():
            widget.setEnabled(snapshot.has(service) and is_met(snapshot))


class ScrolledDown(QScrollArea):
    """Scroll area that scrolls vertically only and is always at least as wide as its content.

    Args:
        content: Widget to scroll.
    """

    def __init__(self, content: QWidget) -> None:
        super().__init__()
        self.setWidget(content)
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Adjusts the minimum width when the layout of the content changes."""
        if event.type() == QEvent.Type.LayoutRequest:
            bar = self.verticalScrollBar()
            self.setMinimumWidth(self.widget().minimumSizeHint().width() + bar.width() * bar.isVisible())
        return bool(super().eventFilter(watched, event))


def named(widget: QWidget, name: str, tip: str = "") -> Any:
    """Sets a widget's tool tip and its Qt object name, by which tests find the widget. Returns the widget."""
    widget.setObjectName(name)
    widget.setToolTip(plain_tip(tip))
    return widget
