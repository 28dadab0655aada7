"""State and input of what runs on a stage: newest messages, positions of frames, windows, mouse and keys."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import rospy
from PIL import Image, ImageGrab
from rviz_view import rviz_camera
from screen import PATIENCE_S, wait_until

from custom_ros_tools.ros.tf_interface import TfInterface

Array = npt.NDArray[np.float64]
REDRAWS_S = 0.5
"""Time in which a raised window draws itself again [s]."""


class Newest:
    """The newest message of a topic.

    Attributes:
        message: The message; None before the first one.
    """

    def __init__(self, topic: str, kind: type) -> None:
        self.message: Any = None
        self._subscriber = rospy.Subscriber(topic, kind, self._store, queue_size=1)

    def _store(self, message: Any) -> None:
        self.message = message


class Frames:
    """Positions of TF frames.

    Args:
        parent: Frame in which positions are given.
    """

    def __init__(self, parent: str = "rpbi/world") -> None:
        self._parent, self._tf = parent, TfInterface()

    def position(self, frame: str) -> Array | None:
        """Returns the newest position of a frame's origin, shape (3,) [m]; None if it is unknown."""
        return self._tf.get_tf(self._parent, frame)[0]

    def wait_for(self, frame: str) -> Array:
        """Returns the position of a frame's origin, shape (3,) [m], as soon as it is known."""
        wait_until(lambda: self.position(frame) is not None, f"frame {frame} is known")
        position = self.position(frame)
        assert position is not None
        return position


class Orbit(NamedTuple):
    """RViz's orbit view.

    Attributes:
        distance_m: Distance of the camera from `focus` [m].
        focus: Point in the middle of the picture [m].
        pitch_rad: Angle of the camera above the horizontal plane [rad].
        yaw_rad: Direction from `focus` to the camera, about the vertical axis [rad].
    """

    distance_m: float
    focus: tuple[float, float, float]
    pitch_rad: float
    yaw_rad: float

    @property
    def properties(self) -> dict[str, Any]:
        """Properties of the view in a `.rviz` file."""
        focus = dict(zip("XYZ", self.focus))
        return {"Distance": self.distance_m, "Focal Point": focus, "Pitch": self.pitch_rad, "Yaw": self.yaw_rad}

    def pixel(self, point: Sequence[float], picture: Image.Image) -> tuple[float, float]:
        """Returns column and row [px] of a point [m] in a picture that shows the whole view."""
        camera = rviz_camera(self.focus, self.distance_m, self.pitch_rad, self.yaw_rad, picture.size)
        return camera.pixel(point)


class Place(NamedTuple):
    """A window, and its edges on the screen [px]."""

    number: str
    left: int
    upper: int
    right: int
    lower: int


def xdotool(*words: object) -> str:
    """Moves mouse and keys on the stage, and returns what xdotool prints."""
    command = ["xdotool", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    return done.stdout


def place(title: str) -> Place:
    """Returns the place of a window as soon as it is visible; `title` is a regular expression."""
    number = xdotool("search", "--sync", "--onlyvisible", "--name", title).split()[0]
    lines = xdotool("getwindowgeometry", "--shell", number).split()
    x, y, width, height = (int(dict(line.split("=") for line in lines)[key]) for key in ("X", "Y", "WIDTH", "HEIGHT"))
    return Place(number, x, y, x + width, y + height)


def grab(window: Place) -> Image.Image:
    """Raises a window and returns its picture, pixel by pixel."""
    xdotool("windowraise", window.number)
    time.sleep(REDRAWS_S)
    return ImageGrab.grab(bbox=window[1:], xdisplay=os.environ["DISPLAY"]).convert("RGB")
