"""The node that opens the controls window."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import roslib.packages
import rospy
from pydantic import Field

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.schema import ConfigModel, Switch, Text, optional
from rpbi_utils.window_node import Opened, run_window

NAME = "rpbi_controls_node"


class ControlsParameters(ConfigModel):
    """Private parameters of the controls window."""

    config: Mapping[str, Any] = Field(
        {}, description="Content of the world's main file, of which only the key `controls` is used."
    )
    robot_name: Text | None = optional(
        "Robot whose joints the window shows first, instead of `config/controls/robot_name`."
    )
    view: Switch = Field(True, description="Whether the window contains RViz's view; requires python3-rviz.")
    rviz_config: Text | None = optional("RViz configuration file for the view. By default, a file of this package.")
    world_frame: Text = Field("rpbi/world", description="TF frame of the simulated world, for the view.")


def main() -> None:
    """Runs the node. Exits with 1 if the node cannot start or has no display, and otherwise with 0."""
    run_window(NAME, _open)


def _open() -> Opened:
    from PyQt5.QtWidgets import QApplication

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
        view = _rviz_view(parameters.rviz_config or str(file), parameters.world_frame)
        if view is None:
            rospy.loginfo("python3-rviz is not installed: the window has no 3-D view")
    window = ControlsWindow(SimulatorLink(), signals, first, view)
    return application, signals, window


def _rviz_view(config_file: str, world_frame: str) -> Any:
    """Returns a widget with RViz's 3-D view, or None if RViz's Python bindings are not installed.

    RViz's own panels are hidden. A right click on RViz's tool bar opens a menu that can show these panels.

    Args:
        config_file: RViz configuration file with the displays and the view.
        world_frame: TF frame that becomes RViz's fixed frame.

    Raises:
        InterfaceError: If the file is missing or is not an RViz configuration.
    """
    try:
        from rviz import bindings
    except ImportError:
        return None
    from PyQt5.QtWidgets import QDockWidget

    if not Path(config_file).is_file():
        raise InterfaceError(f"rviz_config: expected a file of RViz, got {config_file}, which does not exist")
    config = bindings.Config()
    reader = bindings.YamlConfigReader()
    reader.readFile(config, config_file)
    if reader.error():
        raise InterfaceError(f"rviz_config: {config_file}: {reader.errorMessage()}")
    frame = bindings.VisualizationFrame()
    frame.setSplashPath("")
    frame.initialize()
    frame.load(config)
    frame.setMenuBar(None)
    frame.setStatusBar(None)
    frame.setHideButtonVisibility(False)
    for panel in frame.findChildren(QDockWidget):
        panel.hide()
    frame.getManager().setFixedFrame(world_frame)
    return frame
