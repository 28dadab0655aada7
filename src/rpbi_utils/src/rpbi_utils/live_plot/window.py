"""Window of the live plot, with buttons and keys."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from PyQt5.QtCore import QPointF, QRectF, Qt, QTimer
from PyQt5.QtGui import QColor, QPainter, QPaintEvent, QPen, QPixmap, QPolygonF, QResizeEvent
from PyQt5.QtWidgets import QHBoxLayout, QMainWindow, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from custom_ros_tools.files import atomic_file
from rpbi_utils.plain_text import plain_label, plain_tip

from .plot import Line, LivePlot, thinned, ticks

TITLE = "Live plot"
PERIOD_MS = 16
"""Time between two redraws [ms]."""
STATUS_S = 0.5
SIZE = (960, 480)
MIN_SECONDS, MAX_SECONDS = 0.5, 120.0
"""Shortest and longest time that the window shows [s]."""
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b", "#e377c2", "#17becf", "#7f7f7f", "#bcbd22")
LEFT, RIGHT, TOP, BOTTOM = 80, 12, 8, 28
"""Margins around the lines [px]."""
UNIT_WIDTH, GAP = 18, 12
"""Width of the column with the units, and vertical gap between two charts [px]."""
ROW = 17
"""Height of a row of the legend [px]."""
MAX_LEGEND = 10
"""Largest number of rows of the legend. It takes no more than half of the room of its chart."""
GRID, INK, FAULT = QColor("#e0e0e0"), QColor("#303030"), QColor("#a02020")


class Chart(NamedTuple):
    """All lines with the same unit, drawn with a common vertical axis.

    Attributes:
        unit: Unit of the lines.
        lines: Visible lines. The first chart also contains missing lines, with their reasons.
        points: Horizontal positions [px] and values of each line.
        low: Lower end of the vertical axis, in `unit`.
        high: Upper end of the vertical axis, in `unit`.
        legend: Texts and colours of the rows above the chart.
        top: Position of the upper edge [px].
        height: Height of the chart [px].
    """

    unit: str
    lines: list[Line]
    points: list[tuple[np.ndarray, np.ndarray]]
    low: float
    high: float
    legend: list[tuple[str, QColor]]
    top: float
    height: float

    def y(self, value: Any) -> Any:
        """Returns the vertical position [px] of a value, or of each value in an array."""
        return self.top + (self.high - value) * (self.height / (self.high - self.low))


class Canvas(QWidget):
    """Draws the lines over the last `seconds` [s], with one chart per unit."""

    def __init__(self, plot: LivePlot, seconds: float) -> None:
        super().__init__()
        self._plot = plot
        self.seconds = seconds
        self.redraws = 0
        self._shown = -1
        self._frozen: tuple[float, list[Line]] | None = None
        self._grid: QPixmap | None = None
        self._grid_of: tuple[object, ...] = ()
        self.setMinimumSize(320, 200)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    @property
    def is_paused(self) -> bool:
        """Whether the view is paused. Samples are collected during pauses, too."""
        return self._frozen is not None

    def pause(self) -> None:
        """Pauses the view, or continues a paused view."""
        self._frozen = self._plot.view(MAX_SECONDS) if self._frozen is None else None
        self.update()

    def clear(self) -> None:
        """Drops all samples."""
        self._plot.clear()
        if self._frozen is not None:
            self._frozen = self._plot.view(MAX_SECONDS)
        self.update()

    def zoom(self, factor: float) -> None:
        """Multiplies the length of the visible time span by a factor."""
        self.seconds = float(np.clip(self.seconds * factor, MIN_SECONDS, MAX_SECONDS))
        self.update()

    def look(self) -> None:
        """Redraws if the data have changed and the view is not paused."""
        if self._frozen is None and self._plot.changes != self._shown:
            self.update()

    def view(self) -> tuple[float, list[Line]]:
        """Returns the time at the right edge [s], and the lines."""
        return self._plot.view(self.seconds) if self._frozen is None else self._frozen

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 (Qt's name)
        self._grid_of = ()
        super().resizeEvent(event)

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: N802 (Qt's name)
        self._shown = self._plot.changes
        self.redraws += 1
        end_s, lines = self.view()
        charts = self._charts(end_s, lines)
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._background(charts))
        for chart in charts:
            self._draw_legend(painter, chart)
            painter.setClipRect(QRectF(LEFT, chart.top, self.width() - LEFT - RIGHT, chart.height))
            for line, (places, values) in zip(chart.lines, chart.points, strict=True):
                painter.setPen(QPen(_colour(line), 1.0))
                painter.drawPolyline(_polygon(LEFT + places, chart.y(values)))
            painter.setClipping(False)
        painter.end()

    def _charts(self, end_s: float, lines: list[Line]) -> list[Chart]:
        """Returns one chart per unit, from top to bottom. The first chart also includes the lines without samples."""
        of_unit: dict[str, list[Line]] = {}
        for line in lines:
            if not line.note:
                of_unit.setdefault(line.unit, []).append(line)
        of_unit = of_unit or {"": []}
        first = next(iter(of_unit))
        of_unit[first] = [line for line in lines if line.note] + of_unit[first]
        room = (self.height() - TOP - BOTTOM - GAP * (len(of_unit) - 1)) / len(of_unit)
        charts = []
        for number, (unit, own) in enumerate(of_unit.items()):
            points = [self._points(line, end_s, self.width() - LEFT - RIGHT) for line in own]
            low, high = _range([values for _, values in points])
            legend = _legend(own, min(MAX_LEGEND, max(1, int(room / 2 / ROW))))
            top = TOP + number * (room + GAP) + ROW * len(legend)
            charts.append(Chart(unit, own, points, low, high, legend, top, max(1.0, room - ROW * len(legend))))
        return charts

    def _points(self, line: Line, end_s: float, width: int) -> tuple[np.ndarray, np.ndarray]:
        is_finite = np.isfinite(line.values)
        start_s = end_s - self.seconds
        first = int(np.searchsorted(line.times, start_s))
        chosen = slice(max(0, first - 1), None)
        times, values = line.times[chosen][is_finite[chosen]], line.values[chosen][is_finite[chosen]]
        return thinned(times, values, start_s, end_s, width)

    def _background(self, charts: list[Chart]) -> QPixmap:
        """Returns a picture of the axes, which is drawn again only when the axes change."""
        axes = [(chart.unit, chart.low, chart.high, chart.top) for chart in charts]
        wanted = (*axes, self.seconds, self.width(), self.height())
        if self._grid is None or wanted != self._grid_of:
            self._grid_of = wanted
            self._grid = QPixmap(self.size())
            self._grid.fill(QColor("white"))
            painter = QPainter(self._grid)
            for chart in charts:
                self._draw_values(painter, chart)
            self._draw_times(painter, charts)
            painter.end()
        return self._grid

    def _draw_values(self, painter: QPainter, chart: Chart) -> None:
        """Draws the vertical axis of a chart."""
        width, right = self.width() - LEFT - RIGHT, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        values, digits = ticks(chart.low, chart.high, max(2.0, chart.height / 45, min(4.0, chart.height / 28)))
        for value in values:
            y = chart.y(value)
            painter.setPen(GRID)
            painter.drawLine(QPointF(LEFT, y), QPointF(LEFT + width, y))
            painter.setPen(INK)
            text = f"{value:.{digits}f}" if abs(value) < 1e6 and digits < 7 else f"{value:.3g}"
            painter.drawText(QRectF(UNIT_WIDTH, y - 8, LEFT - UNIT_WIDTH - 6, 16), int(right), text)
        painter.save()
        painter.translate(0.0, chart.top + chart.height)
        painter.rotate(-90.0)
        place = QRectF(0.0, 0.0, chart.height, UNIT_WIDTH)
        painter.drawText(place, int(Qt.AlignmentFlag.AlignCenter), f"[{chart.unit}]" if chart.unit else "")
        painter.restore()

    def _draw_times(self, painter: QPainter, charts: list[Chart]) -> None:
        """Draws the time axis, which all charts share."""
        width, bottom = self.width() - LEFT - RIGHT, self.height() - BOTTOM
        centre = Qt.AlignmentFlag.AlignHCenter
        times, digits = ticks(-self.seconds, 0.0, max(2.0, width / 90))
        for time_s in times:
            x = LEFT + width + time_s * width / self.seconds
            painter.setPen(GRID)
            for chart in charts:
                painter.drawLine(QPointF(x, chart.top), QPointF(x, chart.top + chart.height))
            painter.setPen(INK)
            painter.drawText(QRectF(x - 40, bottom + 4, 80, 16), int(centre), f"{time_s:.{digits}f} s")

    def _draw_legend(self, painter: QPainter, chart: Chart) -> None:
        for number, (text, colour) in enumerate(chart.legend):
            top = chart.top - ROW * (len(chart.legend) - number)
            painter.setPen(colour)
            painter.drawText(
                QRectF(LEFT, top, self.width() - LEFT - RIGHT, ROW),
                int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter),
                text,
            )


class LivePlotWindow(QMainWindow):
    """Window with the plot, buttons, the latest status message, and the rates of redraws and values.

    Args:
        plot: Lines to draw.
        seconds: Initial length of the visible time span [s].
        folder: Folder for saved files.
    """

    def __init__(self, plot: LivePlot, seconds: float, folder: Path) -> None:
        super().__init__()
        self.setWindowTitle(TITLE)
        self.plot, self._folder = plot, folder
        self.canvas = Canvas(plot, seconds)
        self._status = _named(plain_label(), "status")
        self._message = _named(plain_label("keys: Space, C, P, D, + and -"), "message")
        self._message.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        buttons = QHBoxLayout()
        self._pause = self._button(buttons, "Pause", "Space", self._on_pause)
        self._button(buttons, "Clear", "C", self._on_clear)
        self._button(buttons, "Save PNG", "P", lambda: self._save("png", self._write_picture))
        self._button(buttons, "Save CSV", "D", lambda: self._save("csv", self._write_data))
        self._button(buttons, "+", "+", lambda: self.canvas.zoom(0.5))
        self._button(buttons, "-", "-", lambda: self.canvas.zoom(2.0))
        buttons.addWidget(self._message, 1)
        buttons.addWidget(self._status)
        layout = QVBoxLayout()
        layout.addWidget(self.canvas, 1)
        layout.addLayout(buttons)
        centre = QWidget()
        centre.setLayout(layout)
        self.setCentralWidget(centre)
        self.resize(*SIZE)
        self._since_s, self._redraws, self._values = time.monotonic(), 0, 0
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._look)
        self._timer.start(PERIOD_MS)

    def end(self) -> None:
        """Stops the periodic redraw."""
        self._timer.stop()

    def _look(self) -> None:
        self.canvas.look()
        passed_s = time.monotonic() - self._since_s
        if passed_s > STATUS_S:
            redraws, values = self.canvas.redraws - self._redraws, self.plot.count - self._values
            self._status.setText(f"{redraws / passed_s:.0f} redraws/s, {values / passed_s:.0f} values/s")
            self._redraws, self._values = self.canvas.redraws, self.plot.count
            self._since_s = time.monotonic()

    def _button(self, layout: QHBoxLayout, title: str, key: str, action: Callable[[], None]) -> QPushButton:
        button: QPushButton = _named(QPushButton(title), title.lower())
        button.setToolTip(plain_tip(key))
        button.setShortcut(key)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # otherwise Space would press the last used button
        button.clicked.connect(lambda: action())
        layout.addWidget(button)
        return button

    def _on_pause(self) -> None:
        self.canvas.pause()
        self._pause.setText("Continue" if self.canvas.is_paused else "Pause")
        self._pause.setShortcut("Space")  # Qt removes the shortcut when the text changes
        self._message.setText("paused" if self.canvas.is_paused else "continues")

    def _on_clear(self) -> None:
        self.canvas.clear()
        self._message.setText("cleared")

    def _save(self, suffix: str, write: Callable[[Path], None]) -> None:
        """Writes a new file in the folder. `write` receives a temporary path, which is renamed at the end."""
        path = self._folder / f"live_plot_{datetime.now().strftime('%Y%m%d_%H%M%S_%f')}.{suffix}"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with atomic_file(path) as part:
                write(part)
        except OSError as error:
            self._message.setText(f"{path}: not saved: {error.strerror or error}")
            return
        self._message.setText(f"saved {path}")

    def _write_picture(self, path: Path) -> None:
        if not self.canvas.grab().save(str(path), "PNG"):
            raise OSError("the picture cannot be written")

    def _write_data(self, path: Path) -> None:
        end_s, lines = self.canvas.view()
        tables = [
            pd.DataFrame({"time": line.times, "field": line.name, "value": line.values})
            for line in lines
            if not line.note
        ]
        table = pd.concat([pd.DataFrame({"time": [], "field": [], "value": []}), *tables])
        table[table["time"] >= end_s - self.canvas.seconds].to_csv(path, index=False)


def _named(widget: QWidget, name: str) -> QWidget:
    widget.setObjectName(name)
    return widget


def _colour(line: Line) -> QColor:
    return FAULT if line.note else QColor(COLOURS[line.number % len(COLOURS)])


def _legend(lines: list[Line], most: int) -> list[tuple[str, QColor]]:
    """Returns at most `most` rows; the last one counts the lines that have none."""
    if len(lines) <= most:
        return [_legend_row(line) for line in lines]
    rows = [_legend_row(line) for line in lines[: most - 1]]
    return [*rows, (f"and {len(lines) - len(rows)} more" if rows else f"{len(lines)} lines", INK)]


def _legend_row(line: Line) -> tuple[str, QColor]:
    newest = f"{line.values[-1]:.4g}" if len(line.values) else ""
    return f"{line.name}: {line.note}" if line.note else f"{line.name}  {newest}", _colour(line)


def _range(values: list[np.ndarray]) -> tuple[float, float]:
    """Returns the lower and upper end of the vertical axis. Both are round numbers, so that the axis changes rarely."""
    filled = [each for each in values if len(each)]
    low = min((float(each.min()) for each in filled), default=0.0)
    high = max((float(each.max()) for each in filled), default=1.0)
    if high - low < 1e-9 * max(1.0, abs(low), abs(high)):
        margin = 0.1 * abs(high) or 1.0
        low, high = low - margin, high + margin
    marks, _ = ticks(low, high, 8)
    step = marks[1] - marks[0]
    return float(np.floor(low / step) * step), float(np.ceil(high / step) * step)


def _polygon(x: np.ndarray, y: np.ndarray) -> QPolygonF:
    """Returns points [px] as a Qt polygon. The arrays are copied as a whole, without a Python object for each point."""
    polygon = QPolygonF(len(x))
    if len(x):
        memory: Any = polygon.data().asarray(16 * len(x))
        points = np.frombuffer(memory, np.float64).reshape(-1, 2)
        points[:, 0], points[:, 1] = x, y
    return polygon
