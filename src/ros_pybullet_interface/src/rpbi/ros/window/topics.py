"""All that PyBullet's window has in ROS."""

import logging
from collections.abc import Callable, Iterator

import pybullet

from rpbi.config.world import WorldConfig
from rpbi.engine.clock import Clock
from rpbi.ros.endpoints import Topic
from rpbi.ros.requests import Requests
from rpbi.window import RECORD, Window
from rpbi.world import World

from .debug_camera import CAMERA, DebugCamera
from .publishers import IMAGE, KEYBOARD, MOUSE, NUMBERS, GuiEvents, VisualizerImage

log = logging.getLogger(__name__)


WINDOW_TOPICS = (CAMERA, KEYBOARD, MOUSE, IMAGE, NUMBERS)
"""Topics of the window."""


class WindowTopics:
    """Opens the configured topics of the window, and warns if there is no window."""

    def __init__(self, world: World) -> None:
        self._camera = DebugCamera(world.window, world.config.resetDebugVisualizerCamera)
        self.polls: tuple[Callable[[], None], ...] = ()
        """To be called at every pass of the loop."""
        if world.window is None:
            _warn_of_idle_keys(world.config)
        else:
            self.polls = (self._camera.poll, *_open(world.window, world.config, world.clock))

    def serve(self, ask: Requests) -> None:
        """Opens the services that the simulation thread answers."""
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


def published_topics(config: WorldConfig) -> list[Topic]:
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
