"""Requirements of Qt windows: PyQt5 and a display."""

import ctypes
import ctypes.util
import os


def missing_for_windows() -> str:
    """Returns a missing requirement of Qt windows in words; empty if none is missing."""
    try:
        import PyQt5.QtWidgets  # noqa: F401
    except ImportError:
        return "PyQt5 is missing: apt install python3-pyqt5"
    if os.environ.get("QT_QPA_PLATFORM") or os.environ.get("WAYLAND_DISPLAY"):
        return ""
    x11 = ctypes.CDLL(ctypes.util.find_library("X11") or "libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:  # Qt would abort
        given = os.environ.get("DISPLAY")
        return f"no display for its window: DISPLAY is {given!r}; on a computer without a screen use xvfb-run"
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return ""
