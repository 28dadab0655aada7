"""RViz's view of a config: where it is on the screen, and where points of the world are in it."""

from __future__ import annotations

import math
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from ros_system import RosSystem, stop_group, wait_until
from screen import Screen, Window

SLOW_S, OPEN_S = 300.0, 150.0
ATTEMPTS = 3
CRASH = re.compile(r"\[rviz-\d+\] process has died \[pid \d+, exit code -(6|11),")
"""What roslaunch says of it: it was aborted, or accessed memory that is not there."""
CRASH_CODES = (-6, -11)
"""The same of RViz alone."""
FIELD_OF_VIEW = math.radians(45.0)
"""Vertical opening of RViz's view."""

FRAMES_HZ = 5

Array = npt.NDArray[np.float64]


class RvizView:
    """RViz's orbit view, as its config has it.

    Args:
        config: The `.rviz` file.
        width: Columns of the picture [px].
        height: Rows [px].
    """

    def __init__(self, config: Path, width: int, height: int) -> None:
        view = yaml.safe_load(config.read_text())["Visualization Manager"]["Views"]["Current"]
        focus = np.array([view["Focal Point"][axis] for axis in "XYZ"])
        yaw, pitch = view["Yaw"], view["Pitch"]
        away = np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)])
        self._eye = focus + view["Distance"] * away
        right = np.cross(-away, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        self._axes = np.array([right, np.cross(-away, right), -away])
        self._focal_px = height / 2 / math.tan(FIELD_OF_VIEW / 2)
        self.width, self.height = width, height

    def project(self, points: Array) -> Array:
        """Returns columns, rows and depths [px, px, m] of points of the world; shape (..., 3)."""
        in_view = (points - self._eye) @ self._axes.T
        depth = in_view[..., 2:]
        pixels = in_view[..., :2] / depth * self._focal_px + np.array([self.width, self.height]) / 2 - 0.5
        return np.concatenate([pixels, depth], axis=-1)


def find_view(screen: Screen) -> Window | None:
    """Returns where RViz's view is, the largest of its windows that have no title; None if it is not there yet."""
    windows = screen.windows()
    views = [window for window in windows if not window.title and min(window.width, window.height) > 300]
    is_open = any("- RViz" in window.title for window in windows)
    return max(views, key=lambda window: window.width * window.height) if is_open and views else None


def _draws(screen: Screen) -> bool:
    """Returns whether RViz has drawn something in its view, such as the grid."""
    view = find_view(screen)
    return view is not None and len(np.unique(screen.grab(view).reshape(-1, 3), axis=0)) > 1


def launch_with_rviz(system: RosSystem, screen: Screen, *arguments: str) -> subprocess.Popen:
    """Launches an example as a user with a screen does, and waits until RViz is open; see `start_with_rviz`."""
    return start_with_rviz(system, screen, "roslaunch", "rpbi_examples", *arguments, "headless:=false")


def start_rviz(system: RosSystem, screen: Screen, config: dict[str, Any], name: str = "view.rviz") -> subprocess.Popen:
    """Starts RViz with a config that draws few frames a second, since software draws them; see `start_with_rviz`."""
    config["Visualization Manager"]["Global Options"]["Frame Rate"] = FRAMES_HZ
    return start_with_rviz(system, screen, "rviz", "-d", system.write_yaml(name, config), "-f", "rpbi/world")


def start_with_rviz(system: RosSystem, screen: Screen, *command: str) -> subprocess.Popen:
    """Starts RViz, or what starts it, and waits until it draws.

    Debian's RViz sometimes, once in some fifty times on a busy machine, crashes while it starts (`free(): invalid next
    size`, exit code -6), or, seen once, never opens or draws. Then it is started again; nothing else is tried twice.
    """
    failures = []
    for _ in range(ATTEMPTS):
        process = system.start(list(command), **screen.environment)
        try:
            said = wait_until(
                lambda process=process: (
                    CRASH.search(system.output(process))
                    or (_draws(screen) and "open")
                    or (process.poll() is not None and ("over" if process.poll() not in CRASH_CODES else process))
                ),
                "RViz draws",
                OPEN_S,
                every_s=0.5,
            )
        except TimeoutError as error:
            said = error
        if isinstance(said, str):
            return process
        failures.append(f"{said}, windows {screen.windows()}:\n{system.output(process)}")
        stop_group(process)
    raise AssertionError(f"RViz did not start in {ATTEMPTS} attempts:\n" + "\n".join(failures))
