"""The program `live_plot`."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.run_node import run_node
from rpbi_utils.windows import missing_for_windows

from .plot import LivePlot

NAME = "live_plot"


def main() -> None:
    """Runs the program; exits with 1 without a display, with 2 for wrong arguments, with 0 when it is closed."""
    arguments = _parser().parse_args(rospy.myargv(sys.argv)[1:])
    if missing := missing_for_windows():
        sys.exit(f"{NAME}: {missing}")
    run_node(
        NAME, partial(_open, arguments), _show, anonymous=True, ros_time=False, loggers=["rpbi_utils", "rpbi_data"]
    )


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


def _open(arguments: argparse.Namespace) -> tuple[Any, Any, Any]:
    from PyQt5.QtCore import QObject, pyqtSignal
    from PyQt5.QtWidgets import QApplication

    from .source_topics import FieldSource
    from .window import LivePlotWindow

    class PlotSignals(QObject):
        """Carries the end of the node into the thread of the window."""

        ended = pyqtSignal()

    application = QApplication([NAME])
    signals = PlotSignals()
    signals.ended.connect(application.quit)
    rospy.on_shutdown(signals.ended.emit)
    plot = LivePlot()
    window = LivePlotWindow(plot, arguments.seconds, arguments.out.absolute())
    return application, (signals, FieldSource(arguments.fields, plot)), window


def _show(opened: tuple[Any, Any, Any]) -> None:
    application, _, window = opened
    if not rospy.core.is_shutdown_requested():
        window.show()
        application.exec_()
    window.hide()
    window.end()
    rospy.signal_shutdown("the window was closed")
