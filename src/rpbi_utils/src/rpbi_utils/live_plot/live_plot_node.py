"""The program `live_plot`."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

import rospy

from rpbi_utils.window_node import Opened, run_window

from .plot import LivePlot

NAME = "live_plot"


def main() -> None:
    """Runs the program. Exits with 1 without a display, with 2 for wrong arguments, and otherwise with 0."""
    arguments = _parser().parse_args(rospy.myargv(sys.argv)[1:])
    run_window(NAME, partial(_open, arguments), anonymous=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=NAME, description="Draws numeric fields of topics while they come.")
    parser.add_argument("fields", nargs="+", metavar="TOPIC/FIELD", type=_name)
    parser.add_argument("--seconds", type=_seconds, default=10.0, metavar="S", help="time that is shown; default: 10")
    parser.add_argument("--out", type=Path, default=Path(), metavar="FOLDER", help="folder of saved files")
    return parser


def _name(text: str) -> str:
    if not text.strip("/") or text.startswith("-") or any(each.isspace() for each in text):
        raise argparse.ArgumentTypeError(f"expected TOPIC/FIELD such as /arm/joint_states/position[0], got {text!r}")
    return text


def _seconds(text: str) -> float:
    from .window import MAX_SECONDS, MIN_SECONDS

    try:
        seconds = float(text)
    except ValueError:
        seconds = float("nan")
    if not MIN_SECONDS <= seconds <= MAX_SECONDS:
        raise argparse.ArgumentTypeError(f"expected {MIN_SECONDS:g} to {MAX_SECONDS:g} seconds, got {text!r}")
    return seconds


def _open(arguments: argparse.Namespace) -> Opened:
    from PyQt5.QtCore import QObject, pyqtSignal
    from PyQt5.QtWidgets import QApplication

    from .source_topics import FieldSource
    from .window import LivePlotWindow

    class PlotSignals(QObject):
        """Qt signal that passes the node's shutdown to the window's thread."""

        ended = pyqtSignal()

    application = QApplication([NAME])
    signals = PlotSignals()
    signals.ended.connect(application.quit)
    rospy.on_shutdown(signals.ended.emit)
    plot = LivePlot()
    window = LivePlotWindow(plot, arguments.seconds, arguments.out.absolute())
    return application, (signals, FieldSource(arguments.fields, plot)), window
