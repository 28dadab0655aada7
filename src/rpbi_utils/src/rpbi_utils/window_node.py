"""Runs a node with a Qt window, which requires PyQt5 and a display."""

import ctypes
import ctypes.util
import os
import sys
from collections.abc import Callable
from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.run_node import run_node

Opened = tuple[Any, Any, Any]
"""Qt application, objects to keep alive while the window is open, and the window. The window has a method `end`."""


def run_window(name: str, open_window: Callable[[], Opened], *, anonymous: bool = False) -> None:
    """Runs a node until its window is closed. Exits with 1 if PyQt5 or a display is missing.

    Args:
        name: Name of the node.
        open_window: Function that creates the Qt application and its window.
        anonymous: Whether ROS makes the node's name unique, so that several such nodes can run.
    """
    if missing := _missing():
        sys.exit(f"{name}: {missing}")
    run_node(name, open_window, _show, anonymous=anonymous, ros_time=False, loggers=["rpbi_utils", "rpbi_data"])


def _show(opened: Opened) -> None:
    application, _, window = opened
    if not rospy.core.is_shutdown_requested():
        window.show()
        application.exec_()
    window.hide()
    window.end()
    rospy.signal_shutdown("the window was closed")


def _missing() -> str:
    """Returns an error message if PyQt5 or a display is missing, otherwise an empty text."""
    try:
        import PyQt5.QtWidgets  # noqa: F401
    except ImportError:
        return "PyQt5 is missing: apt install python3-pyqt5"
    if os.environ.get("QT_QPA_PLATFORM") or os.environ.get("WAYLAND_DISPLAY"):
        return ""
    x11 = ctypes.CDLL(ctypes.util.find_library("X11") or "libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:  # without a display, Qt would abort the process
        given = os.environ.get("DISPLAY")
        return f"no display for its window: DISPLAY is {given!r}; on a computer without a screen use xvfb-run"
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return ""
