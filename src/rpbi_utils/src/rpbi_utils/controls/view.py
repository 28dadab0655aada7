"""RViz's view of the world."""

from pathlib import Path
from typing import Any

from PyQt5.QtWidgets import QDockWidget

from custom_ros_tools.errors import InterfaceError


def rviz_view(config_file: str, world_frame: str) -> Any:
    """Returns a widget with RViz's 3-D view, or None if its Python bindings are not installed.

    Its panels are hidden; the menu of its tool bar, by a right click, shows them.

    Args:
        config_file: Displays and view, as RViz saves them.
        world_frame: Its fixed frame.

    Raises:
        InterfaceError: If the file is missing or is no configuration of RViz.
    """
    try:
        from rviz import bindings
    except ImportError:
        return None
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
