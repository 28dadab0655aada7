"""What PyBullet's window shows, as images."""

from __future__ import annotations

import struct
import time
from typing import IO

import numpy as np
import numpy.typing as npt
import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Int64MultiArray

from rpbi.engine.clock import Clock
from rpbi.ros.headers import to_ros_time
from rpbi.window import Window

IMAGE_TOPIC = "rpbi/visualizer_image"
NUMBERS_TOPIC = "rpbi/visualizer_image_int"
LARGEST_SHARE = 0.25
"""Of wall time, that drawing may take from physics: images come less often rather than that."""


class VisualizerImage:
    """Draws and publishes images while somebody looks at them.

    Args:
        window: The window.
        clock: The world's clock.
        hz: Most images a second of wall time.
        width_px: Columns.
        height_px: Rows.
    """

    def __init__(self, window: Window, clock: Clock, hz: float, width_px: int, height_px: int) -> None:
        self._window, self._clock = window, clock
        self._period_s = 1.0 / hz
        self._size = width_px, height_px
        self._due_s = 0.0
        self._images = rospy.Publisher(IMAGE_TOPIC, Image, queue_size=2)
        self._numbers = rospy.Publisher(NUMBERS_TOPIC, Int64MultiArray, queue_size=2)

    def poll(self) -> None:
        """Draws an image if it is time to and somebody looks."""
        start_s = time.monotonic()
        if start_s < self._due_s:
            return
        self._due_s = max(self._due_s + self._period_s, start_s)
        as_image, as_numbers = (topic.get_num_connections() > 0 for topic in (self._images, self._numbers))
        if not as_image and not as_numbers:
            return
        rgba = self._window.image(*self._size)
        if as_image:
            self._images.publish(self._message(rgba))
        if as_numbers:
            self._numbers.publish(_Numbers(rgba))
        end_s = time.monotonic()
        self._due_s = max(self._due_s, start_s + (end_s - start_s) / LARGEST_SHARE)

    def _message(self, rgba: npt.NDArray[np.uint8]) -> Image:
        height, width, _ = rgba.shape
        message = Image(height=height, width=width, encoding="rgb8", step=3 * width)
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        message.data = rgba[..., :3].tobytes()
        return message


class _Numbers(Int64MultiArray):  # type: ignore[misc]
    """Red, green, blue and alpha of each pixel; written at once, since one by one takes a tenth of a second."""

    def __init__(self, rgba: npt.NDArray[np.uint8]) -> None:
        super().__init__()
        self._rgba = rgba

    def serialize(self, buff: IO[bytes]) -> None:
        """Writes an empty layout, the count of the numbers and the numbers."""
        buff.write(struct.pack("<III", 0, 0, self._rgba.size))
        buff.write(self._rgba.astype("<i8").tobytes())
