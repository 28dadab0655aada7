"""The node `browser_view_node.py`, which shows a running simulator in browsers."""

from __future__ import annotations

import rospy
from pydantic import Field

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.schema import ConfigModel, Count, Text

HOST, PORT = "127.0.0.1", 8080
FIRST_S = 5.0
"""Longest time to wait for the first shapes before the link is printed [s]."""


class BrowserViewParameters(ConfigModel):
    """Parameters of `browser_view_node.py`."""

    host: Text = Field(
        HOST,
        description="Address to listen at. `0.0.0.0` serves other computers, too; the printed link then has a token.",
    )
    port: Count = Field(PORT, description="Port of the page; 0 chooses a free port.")


class BrowserViewNode:
    """Shows the simulator in the node's namespace in browsers, and prints the link.

    Raises:
        InterfaceError: If a parameter is wrong, the port is in use, or the extra `html` is missing.
    """

    def __init__(self) -> None:
        from .live_view import LiveView  # these need an extra
        from .web_server import WebServer
        from .world_services import ServiceControls
        from .world_topics import TopicSource

        parameters = private_parameters(BrowserViewParameters)
        namespace = rospy.get_namespace()
        server = WebServer(parameters.host, parameters.port)
        source = TopicSource(namespace)
        controls = ServiceControls(namespace, source)
        self._view = LiveView(source, controls, server)
        rospy.on_shutdown(self._view.close)
        self._view.is_drawn.wait(FIRST_S)
        print(f"view: {self._view.link}", flush=True)


def main() -> None:
    """Runs the node."""
    run_node("browser_view", BrowserViewNode, ros_time=False)
