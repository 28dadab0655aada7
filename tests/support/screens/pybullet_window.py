"""A simulator with PyBullet's window, and what is to be seen in it."""

from __future__ import annotations

import subprocess
from typing import Any

import numpy as np
import numpy.typing as npt
from ros_system import wait_until
from screen import Screen, Window

WIDTH, HEIGHT = 480, 360
SLOW_S = 120.0
Array = npt.NDArray[Any]


def open_window(ros: Any, screen: Screen, options: str = "", **main: Any) -> subprocess.Popen[bytes]:
    """Starts a simulator with a window and waits until that is there; returns its process.

    Args:
        ros: Where it is started.
        screen: Where its window is.
        options: Further options of `connect`.
        main: The main configuration.
    """
    config = {
        "connect": {"connection_mode": "GUI", "options": f"--width={WIDTH} --height={HEIGHT} {options}"},
        "timeStep": 0.01,
        **main,
    }
    node: subprocess.Popen[bytes] = ros.simulator(config, use_sim_time=True, **screen.environment)
    wait_until(lambda: window(screen), "there is a window", SLOW_S)
    return node


def window(screen: Screen) -> Window | None:
    """Returns PyBullet's window, None if there is none."""
    return next((each for each in screen.windows() if each.title.startswith("Bullet Physics")), None)


def floating_ball(ros: Any, name: str, rgba: list[float], position: list[float], radius_m: float = 0.15) -> str:
    """Writes the configuration of a ball that floats; returns its file."""
    shape = {
        "shapeType": "GEOM_SPHERE",
        "radius": radius_m,
        "rgbaColor": rgba,
        "specularColor": [0.0, 0.0, 0.0],
        "visualFramePosition": position,
    }
    path: str = ros.write_yaml(f"{name}.yaml", {"name": name, "createVisualShape": shape})
    return path


def mostly(picture: Array, channel: int) -> Array:
    """Returns the pixels of a picture that are red (0), green (1) or blue (2) above all."""
    others = np.delete(picture.astype(int), channel, axis=-1)
    found: Array = picture[..., channel] > 2 * others.max(axis=-1) + 20
    return found


def middle(mask: Array) -> tuple[float, float]:
    """Returns column and row of the middle of a mask [px]."""
    rows, columns = np.nonzero(mask)
    return float(columns.mean()), float(rows.mean())
