"""Pictures of windows: a ROS master, launch files and windows on a virtual screen that only the picture sees."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeVar

import rosgraph
import rospy
import yaml
from PIL import Image, ImageGrab

from custom_ros_tools.ros.lifecycle.timed_master import unused_port

T = TypeVar("T")

SUPERSAMPLING = 2
"""Rows and columns of the screen for each row and column of the picture."""
PATIENCE_S = 120.0
"""Longest wait for a window or a state [s]."""
SETTLES_S = 3.0
"""Time that RViz needs to show the latest messages, since software renders its frames [s]."""


def wait_until(condition: Callable[[], T], meaning: str, timeout_s: float = PATIENCE_S) -> T:
    """Waits until a condition is true, and returns its value.

    Raises:
        TimeoutError: If the condition stays false; the message names its meaning.
    """
    end_s = time.monotonic() + timeout_s
    while not (value := condition()):
        if time.monotonic() > end_s:
            raise TimeoutError(f"not within {timeout_s:g} s: {meaning}")
        time.sleep(0.1)
    return value


class Stage:
    """A virtual screen and a ROS master, on which launch files and windows run until the `with` block ends.

    The process is a node of this master and can publish topics and call services.

    Args:
        width: Columns of the picture [px].
        height: Rows of the picture [px].
        scale: Rows and columns of the screen for each of the picture. Text in windows becomes smaller by this factor.
    """

    def __init__(self, width: int = 1280, height: int = 800, scale: int = SUPERSAMPLING) -> None:
        self.width, self.height, self._scale = width, height, scale
        self._exits = ExitStack()

    def __enter__(self) -> Stage:
        """Starts the screen and the master."""
        reader, writer = os.pipe()
        size = f"{self.width * self._scale}x{self.height * self._scale}x24"
        screen = ["Xvfb", "-displayfd", str(writer), "-screen", "0", size, "-nolisten", "tcp", "-noreset"]
        self.start(screen, pass_fds=[writer])
        os.close(writer)
        with os.fdopen(reader) as answer:
            self.display = f":{answer.readline().strip()}"
        port = unused_port()
        environment = {"DISPLAY": self.display, "LIBGL_ALWAYS_SOFTWARE": "1"}
        os.environ.update({"ROS_MASTER_URI": f"http://localhost:{port}", **environment})
        self.start(["roscore", "-p", str(port)], stdout=subprocess.DEVNULL)
        wait_until(rosgraph.is_master_online, "a ROS master runs")
        rospy.init_node("pictures", disable_signals=True)
        return self

    def __exit__(self, *_: object) -> None:
        """Ends all started programs, the latest first."""
        rospy.signal_shutdown("the picture is drawn")
        self._exits.close()

    def start(self, command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
        """Starts a program, and ends it by SIGINT with its children when the `with` block ends."""
        process = subprocess.Popen([*map(str, command)], start_new_session=True, **options)
        self._exits.callback(_stop, process)
        return process

    def launch(self, name: str, *arguments: str, package: str = "rpbi_examples") -> subprocess.Popen[bytes]:
        """Starts a launch file without RViz; see `rviz`."""
        return self.start(["roslaunch", package, name, "rviz:=false", *arguments])

    def rviz(self, config: Path, **view: Any) -> None:
        """Opens RViz over the whole screen, with only its 3-D view.

        Args:
            config: The `.rviz` file.
            view: Properties of the view that replace those of the file, such as `Distance=1.5`.
        """
        content = yaml.safe_load(config.read_text(encoding="utf-8"))
        content["Visualization Manager"]["Views"]["Current"].update(view)
        content["Window Geometry"] = {"Hide Left Dock": True, "Hide Right Dock": True}
        folder = self._exits.enter_context(tempfile.TemporaryDirectory())
        path = Path(folder) / "view.rviz"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        self.start(["rviz", "--fullscreen", "-d", str(path), "-f", "rpbi/world"])
        wait_until(lambda: len(self.picture().getcolors(1 << 24) or ()) > 50, "RViz draws")
        time.sleep(SETTLES_S)

    def picture(self) -> Image.Image:
        """Returns the screen without cursor, in the size of the picture."""
        return ImageGrab.grab(xdisplay=self.display).convert("RGB").reduce(self._scale)


def _stop(process: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                continue
