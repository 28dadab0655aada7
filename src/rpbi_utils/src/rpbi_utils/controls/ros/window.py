"""The controls window."""

from PyQt5.QtCore import QObject, Qt, QTimer, pyqtSignal
from PyQt5.QtWidgets import QMainWindow, QSplitter, QVBoxLayout, QWidget

from rpbi_utils.controls.requests import BackgroundRequests, RequestResult
from rpbi_utils.plain_text import plain_label, plain_tip

from .cameras import CamerasPanel
from .joints import JointsPanel
from .link import SimulatorLink
from .objects import ObjectsPanel
from .panel import Panel, ScrolledDown, named
from .recording import RecordingPanel
from .run import MpcPanel, PlannerPanel, RunPanel

TITLE = "ROS-PyBullet Interface Controls"
REFRESH_MS = 100
SIZE, SIZE_WITH_VIEW = (920, 760), (1400, 800)
"""Initial width and height [px]."""


class Signals(QObject):
    """Qt signals that pass events from other threads to the window's thread.

    Attributes:
        answered: Emitted with the result of each background request.
        ended: Emitted when the node shuts down.
    """

    answered = pyqtSignal(object)
    ended = pyqtSignal()


class ControlsWindow(QMainWindow):
    """Main window: control panels at the left, an optional RViz view at the right, the newest message at the bottom.

    Args:
        link: Access to the running simulator.
        signals: Signals that deliver the results of background requests to the window's thread.
        first: Name of the robot whose joints are initially shown; None for the first robot.
        view: Widget with RViz's 3-D view; None for a window without the view.
    """

    def __init__(self, link: SimulatorLink, signals: Signals, first: str | None, view: QWidget | None) -> None:
        super().__init__()
        self.setWindowTitle(TITLE)
        self._link = link
        requests = BackgroundRequests(signals.answered.emit)
        signals.answered.connect(self._on_answer)
        left: list[Panel] = [
            RunPanel(link, requests),
            MpcPanel(link, requests),
            PlannerPanel(link, requests),
            JointsPanel(link, requests, first),
        ]
        right: list[Panel] = [
            ObjectsPanel(link, requests),
            CamerasPanel(link, requests),
            RecordingPanel(link, requests),
        ]
        self._panels = left + right
        splitter = QSplitter(Qt.Orientation.Horizontal)
        for panels in (left, right):
            splitter.addWidget(_column(panels))
        if view is not None:
            splitter.addWidget(view)
            splitter.setStretchFactor(2, 1)
            splitter.setSizes([430, 330, 640])
        else:
            splitter.setSizes([520, 400])
        self.setCentralWidget(splitter)
        self._message = named(plain_label("Messages appear here."), "message")
        self._message.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._message.setWordWrap(True)
        self._message.setContentsMargins(8, 0, 8, 4)
        two_lines = 2 * self._message.fontMetrics().lineSpacing() + 4
        self._message.setFixedHeight(two_lines)  # otherwise a new message would shift the buttons
        self.statusBar().addWidget(self._message, 1)
        self.resize(*(SIZE if view is None else SIZE_WITH_VIEW))
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.refresh)
        self._timer.start(REFRESH_MS)
        self.refresh()

    def refresh(self) -> None:
        """Updates all panels with the simulator's present state."""
        snapshot = self._link.snapshot()
        for panel in self._panels:
            panel.refresh(snapshot)

    def end(self) -> None:
        """Stops the periodic refresh and closes all panels, which ends a running recording."""
        self._timer.stop()
        for panel in self._panels:
            panel.close()

    def _on_answer(self, outcome: RequestResult) -> None:
        if outcome.then is not None:
            outcome.then(outcome)
        text = outcome.error or ("done" if outcome.value is None else outcome.value)
        if isinstance(text, str):  # other values are data for a panel, not messages
            seconds = outcome.duration_s
            duration = f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{seconds:.1f} s"
            self._message.setText(f"{outcome.name}: {text} ({duration})")
            self._message.setToolTip(plain_tip(self._message.text()))
            self._message.setStyleSheet("color: #a02020" if outcome.error else "")
        self.refresh()


def _column(panels: list[Panel]) -> QWidget:
    """Returns a column of panels, with a scroll bar if the window is not high enough."""
    column = QWidget()
    layout = QVBoxLayout(column)
    for panel in panels:
        layout.addWidget(panel, 0 if isinstance(panel, RunPanel | MpcPanel | PlannerPanel | RecordingPanel) else 1)
    return ScrolledDown(column)
