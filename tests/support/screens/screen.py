"""A virtual screen for windows, and pictures of it."""

from __future__ import annotations

import os
import re
import subprocess
import time
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import ImageGrab
from tries import tries

PATIENCE_S = 60.0


class Window(NamedTuple):
    """A window and where it is on the screen [px].

    Attributes:
        title: Its name, empty if it has none.
        x: Its left column.
        y: Its upper row.
        width: Columns.
        height: Rows.
    """

    title: str
    x: int
    y: int
    width: int
    height: int


class Screen:
    """An X server without a monitor, drawn by software, on a display that nobody else has.

    Args:
        width: Columns [px].
        height: Rows [px].
    """

    def __init__(self, width: int = 1400, height: int = 900) -> None:
        reader, writer = os.pipe()
        command = ["Xvfb", "-displayfd", str(writer), "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp"]
        command.append("-noreset")  # else it restarts when a window closes that was its only client, and refuses others
        self._server = subprocess.Popen(
            command, pass_fds=[writer], stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        os.close(writer)
        with os.fdopen(reader) as answer:
            number = answer.readline().strip()
        assert number, f"{command} did not start"
        self.environment = {"DISPLAY": f":{number}", "LIBGL_ALWAYS_SOFTWARE": "1"}

    def grab(self, window: Window | None = None) -> npt.NDArray[np.uint8]:
        """Returns what is to be seen on the screen, or where a window is; shape (height, width, 3)."""
        pixels = np.asarray(ImageGrab.grab(xdisplay=self.environment["DISPLAY"]).convert("RGB"))
        return pixels if window is None else pixels[window.y :, window.x :][: window.height, : window.width]

    def windows(self) -> list[Window]:
        """Returns all windows, those inside of others too."""
        line = re.compile(r'0x\w+ (?:"(.*)"|\(has no name\)): \(.*\) +(\d+)x(\d+)\S+ +\+(-?\d+)\+(-?\d+)')
        found = []
        for _ in tries("the screen tells its windows"):
            try:
                found = line.findall(self.run("xwininfo", "-root", "-tree"))
                break
            except subprocess.CalledProcessError:  # a window went while it made the list
                time.sleep(0.05)
        return [Window(title, int(x), int(y), int(w), int(h)) for title, w, h, x, y in found]

    def run(self, *command: str) -> str:
        """Runs a program that talks to the screen and returns what it printed.

        Raises:
            subprocess.TimeoutExpired: If it does not end, as one that waits for a window that does not come.
        """
        environment = {**os.environ, **self.environment}
        options = {"capture_output": True, "text": True, "check": True, "timeout": PATIENCE_S}
        return subprocess.run(command, env=environment, **options).stdout

    def close(self) -> None:
        """Ends the server."""
        self._server.terminate()
        try:
            self._server.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
