"""Shows a world in browsers while a script or a notebook steps it; `World.view` uses this module."""

from __future__ import annotations

import html
import time

from rpbi.world import World

from .live_view import LiveView
from .script_controls import WorldControls
from .script_source import WorldSource
from .web_server import WebServer

PAUSE_S = 0.005
"""Time between two looks for requests while the world waits [s]."""


class WorldView:
    """Shows a world in browsers. A notebook shows the page if this object is the last line of a cell.

    The view is drawn and its buttons are served when the world is stepped. `Stop` makes the next `World.step` wait
    until `Start` is pressed. Only the thread of the world may create and close this object.

    Args:
        world: The world.
        host: Address to listen at.
        port: Port of the page; 0 chooses a free port.

    Raises:
        InterfaceError: If the port is in use, or the extra `html` is missing.
    """

    def __init__(self, world: World, host: str, port: int) -> None:
        server = WebServer(host, port)
        self._source = WorldSource(world)
        self._controls = WorldControls(world)
        self._view = LiveView(self._source, self._controls, server)
        self._is_closed = False
        self.update()

    @property
    def link(self) -> str:
        """Address of the page."""
        return self._view.link

    def update(self) -> None:
        """Serves requests of viewers, and shows the world as it is now; every `World.step` calls this method."""
        if self._is_closed:
            return
        self._source.update()
        self._controls.serve()
        while self._controls.is_paused and not self._is_closed:
            time.sleep(PAUSE_S)
            self._source.update()
            self._controls.serve()

    def close(self) -> None:
        """Ends the view and its web server."""
        self._is_closed = True
        self._view.close()
        self._source.close()

    def __enter__(self) -> WorldView:
        """Returns itself; the end of the `with` block calls `close`."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.link)}" width="100%" height="500" style="border: 0"></iframe>'
