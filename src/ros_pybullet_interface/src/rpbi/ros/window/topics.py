"""All that PyBullet's window has in ROS."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pybullet
from sensor_msgs.msg import Image
from std_msgs.msg import Int64MultiArray

from ros_pybullet_interface.msg import KeyboardEvent, MouseEvent, ResetDebugVisualizerCamera
from rpbi.config.world import WorldConfig
from rpbi.engine.clock import Clock
from rpbi.ros.requests import Requests
from rpbi.window import RECORD, Window
from rpbi.world import World

from .debug_camera import CAMERA_TOPIC, DebugCamera
from .events import KEYBOARD_TOPIC, MOUSE_TOPIC, GuiEvents
from .image import IMAGE_TOPIC, NUMBERS_TOPIC, VisualizerImage

log = logging.getLogger(__name__)


class WindowTopic(NamedTuple):
    """A topic that the window publishes.

    Attributes:
        key: The key of the main file that opens it, empty if none is needed.
        name: Its relative name.
        message_type: Its ROS type.
        meaning: What it tells, in a sentence.
    """

    key: str
    name: str
    message_type: type
    meaning: str


WINDOW_TOPICS = (
    WindowTopic("", CAMERA_TOPIC, ResetDebugVisualizerCamera, "Where the window looks from now; 30 Hz."),
    WindowTopic("enable_keyboard_publisher", KEYBOARD_TOPIC, KeyboardEvent, "Keys; with `enable_keyboard_publisher`."),
    WindowTopic("enable_mouse_publisher", MOUSE_TOPIC, MouseEvent, "The mouse; with `enable_mouse_publisher`."),
    WindowTopic(
        "publish_visualizer_image_hz",
        IMAGE_TOPIC,
        Image,
        "What the window shows, `rgb8`; at most `publish_visualizer_image_hz`.",
    ),
    WindowTopic(
        "publish_visualizer_image_hz",
        NUMBERS_TOPIC,
        Int64MultiArray,
        "The same as red, green, blue, alpha of each pixel, row by row.",
    ),
)


class WindowTopics:
    """Opens the topics of the window that the configuration asks for, and says so if there is no window.

    Args:
        world: The world.
    """

    def __init__(self, world: World) -> None:
        self._camera = DebugCamera(world.window)
        self.polls: tuple[Callable[[], None], ...] = ()
        """To be called at every pass of the loop."""
        if world.window is None:
            _warn_of_idle_keys(world.config)
        else:
            self.polls = (self._camera.poll, *_open(world.window, world.config, world.clock))

    def serve(self, ask: Requests) -> None:
        """Opens what needs the simulation thread to answer.

        Args:
            ask: Reaches it.
        """
        self._camera.serve(ask)


def _open(window: Window, config: WorldConfig, clock: Clock) -> Iterator[Callable[[], None]]:
    keyboard, mouse = config.enable_keyboard_publisher, config.enable_mouse_publisher
    if keyboard and not _asks_for_shortcuts(config):
        window.leave_keys_to_others()
    if keyboard or mouse:
        yield GuiEvents(window, clock, keyboard, mouse).poll
    if config.publish_visualizer_image_hz:
        size = config.visualizer_image_width, config.visualizer_image_height
        yield VisualizerImage(window, clock, config.publish_visualizer_image_hz, *size).poll


def published_topics(config: WorldConfig) -> list[WindowTopic]:
    """Returns the topics of the window that a world with this configuration publishes."""
    if config.connect.connection_mode == pybullet.DIRECT:
        return []
    return [topic for topic in WINDOW_TOPICS if not topic.key or getattr(config, topic.key)]


def _warn_of_idle_keys(config: WorldConfig) -> None:
    keys = [key for key in dict.fromkeys(topic.key for topic in WINDOW_TOPICS) if key and getattr(config, key)]
    if RECORD in (config.connect.options or ""):
        keys.append(f"connect.options {RECORD}")
    if keys:
        log.warning("%s: no effect without a window (connection_mode: DIRECT)", ", ".join(keys))


def _asks_for_shortcuts(config: WorldConfig) -> bool:
    configured = config.configureDebugVisualizer
    return configured.enable and pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS in configured.flag
