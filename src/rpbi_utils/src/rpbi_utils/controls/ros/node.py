"""The node that opens the controls window."""

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
from rpbi_utils.windows import missing_for_windows

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
    if missing := missing_for_windows():
        sys.exit(f"{NAME}: {missing}")
    run_node(NAME, _open, _show, ros_time=False, loggers=["rpbi_utils", "rpbi_data"])


def _open() -> tuple[Any, Any, Any]:
    from PyQt5.QtWidgets import QApplication

    from rpbi_utils.controls.view import rviz_view

    from .link import SimulatorLink
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
