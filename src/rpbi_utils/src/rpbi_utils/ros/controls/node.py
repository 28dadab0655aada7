"""The node that opens the controls window."""

import ctypes
import ctypes.util
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import roslib.packages
import rospy
from pydantic import Field

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.schema import ConfigModel, Switch, Text, optional

NAME = "rpbi_controls_node"


class ControlsParameters(ConfigModel):
    """Private parameters of the controls window."""

    config: Mapping[str, Any] = Field({}, description="Main file of the world; `controls` is read.")
    robot_name: Text | None = optional("Robot whose joints are shown first, instead of `config/controls/robot_name`.")
    view: Switch = Field(True, description="Whether RViz's view is in the window, where python3-rviz is installed.")
    rviz_config: Text | None = optional("Configuration of RViz for the view, instead of this package's.")
    world_frame: Text = Field("rpbi/world", description="TF frame of the world, for the view.")


def main() -> None:
    """Runs the node; exits with 1 if it cannot start or has no display, with 0 when it is interrupted or closed."""
    missing = _missing()
    if missing:
        sys.exit(f"{NAME}: {missing}")
    run_node(NAME, _open, _show, ros_time=False, loggers=["rpbi_utils"])


def _missing() -> str:
    """Returns what the window lacks here; empty if nothing."""
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


def _open() -> tuple[Any, Any, Any]:
    from PyQt5.QtWidgets import QApplication

    from .link import SimulatorLink
    from .panels.view import rviz_view
    from .window import ControlsWindow, Signals

    parameters = private_parameters(ControlsParameters)
    controls = parameters.config.get("controls") or {}
    first = parameters.robot_name or (controls.get("robot_name") if isinstance(controls, Mapping) else None)
    application = QApplication(["rpbi_controls"])
    signals = Signals()
    signals.ended.connect(application.quit)
    rospy.on_shutdown(signals.ended.emit)
    view = None
    if parameters.view:
        file = Path(roslib.packages.get_pkg_dir("rpbi_utils")) / "configs/controls/view.rviz"
        view = rviz_view(parameters.rviz_config or str(file), parameters.world_frame)
        if view is None:
            rospy.loginfo("python3-rviz is not installed: the window has no 3-D view")
    window = ControlsWindow(SimulatorLink(), signals, first, view)
    return application, signals, window


def _show(opened: tuple[Any, Any, Any]) -> None:
    application, _, window = opened
    if not rospy.core.is_shutdown_requested():
        window.show()
        application.exec_()
    window.hide()
    window.end()
    rospy.signal_shutdown("the window was closed")
