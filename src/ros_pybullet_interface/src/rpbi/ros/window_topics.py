"""Topics and service of PyBullet's window: its keys, mouse, image and camera."""

import logging
import struct
import time
from collections.abc import Callable, Iterator
from typing import IO, Any

import numpy as np
import numpy.typing as npt
import pybullet
import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Int64MultiArray

from custom_ros_tools.errors import ConfigError, InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import WallRate
from ros_pybullet_interface.msg import KeyboardEvent
from ros_pybullet_interface.msg import MouseEvent as MouseMessage
from ros_pybullet_interface.msg import ResetDebugVisualizerCamera as CameraMessage
from ros_pybullet_interface.srv import GetDebugVisualizerCamera
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera
from rpbi.config.world import WorldConfig
from rpbi.engine.clock import Clock
from rpbi.window import DOWN, PRESSED, RECORD, RELEASED, MouseEvent, Window, WindowKeyEvent
from rpbi.world import World

from .endpoints import Service, Topic, serve, subscribe
from .headers import to_ros_time
from .requests import Requests

log = logging.getLogger(__name__)

KEYBOARD = Topic(
    "rpbi/keyboard", KeyboardEvent, meaning="Keys; with `enable_keyboard_publisher`.", key="enable_keyboard_publisher"
)
MOUSE = Topic(
    "rpbi/mouse", MouseMessage, meaning="The mouse; with `enable_mouse_publisher`.", key="enable_mouse_publisher"
)
IMAGE = Topic(
    "rpbi/visualizer_image",
    Image,
    meaning="Image of the window, `rgb8`; at most `publish_visualizer_image_hz`.",
    key="publish_visualizer_image_hz",
)
NUMBERS = Topic(
    "rpbi/visualizer_image_int",
    Int64MultiArray,
    meaning="The same as red, green, blue, alpha of each pixel, row by row.",
    key="publish_visualizer_image_hz",
)
CAMERA = Topic("rpbi/debug_visualizer_camera", CameraMessage, meaning="Present view of the window; 30 Hz.")
WINDOW_TOPICS = (CAMERA, KEYBOARD, MOUSE, IMAGE, NUMBERS)
"""Topics that the node publishes for the window."""
CAMERA_HZ = 30.0
LARGEST_SHARE = 0.25
"""Largest share of wall time that drawing may take; if drawing is slower, fewer images are published."""
HELD_HZ = 60.0
"""Rate [Hz], in wall time, at which a held key is published; presses and releases are published at once."""
KEY_WORDS = {DOWN: "key_is_down", PRESSED: "", RELEASED: "key_was_released"}
MOUSE_WORDS = {1: "mouse_move_event", 2: "mouse_button_event"}
NO_BUTTON = 255


class GuiEvents:
    """Publishes keyboard and mouse events of the window; new subscribers do not get earlier events.

    Args:
        window: The window.
        clock: The world's clock, for the stamps.
        keyboard: Whether to publish keyboard events.
        mouse: Whether to publish mouse events.
    """

    def __init__(self, window: Window, clock: Clock, keyboard: bool, mouse: bool) -> None:
        self._window, self._clock = window, clock
        self._keys = rospy.Publisher(KEYBOARD.name, KeyboardEvent, queue_size=100) if keyboard else None
        self._mouse = rospy.Publisher(MOUSE.name, MouseMessage, queue_size=100) if mouse else None
        self._held_rate = WallRate(HELD_HZ)

    def poll(self) -> None:
        """Publishes the events since the last call."""
        if self._keys is not None:
            self._poll_keys(self._keys)
        if self._mouse is not None:
            for event in self._window.mouse_events():
                self._mouse.publish(self._mouse_message(event))

    def _poll_keys(self, publisher: rospy.Publisher) -> None:
        events = list(self._window.key_events())
        if not events:
            return
        is_due = self._held_rate.is_due()
        if is_due:
            self._held_rate.rest(1.0 / HELD_HZ)  # so that the next one is due a full period from now
        for event in events:
            if is_due or event.state != DOWN:
                publisher.publish(self._key_message(event))

    def _key_message(self, event: WindowKeyEvent) -> KeyboardEvent:
        message = KeyboardEvent(key=event.key, state=event.state, state_str=KEY_WORDS[event.state])
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        return message

    def _mouse_message(self, event: MouseEvent) -> MouseMessage:
        message = MouseMessage(
            event_type=event.kind,
            event_type_str=MOUSE_WORDS.get(event.kind, ""),
            mouse_pos_x=event.x,
            mouse_pos_y=event.y,
            button_index=event.button if event.button >= 0 else NO_BUTTON,
            button_state=event.state,
            button_state_str=event.state,
        )
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        return message


class VisualizerImage:
    """Draws and publishes images of the window while their topics have subscribers.

    Args:
        window: The window.
        clock: The world's clock, for the stamps.
        hz: Maximum rate [Hz] of the images, in wall time.
        width_px: Number of columns of an image.
        height_px: Number of rows of an image.
    """

    def __init__(self, window: Window, clock: Clock, hz: float, width_px: int, height_px: int) -> None:
        self._window, self._clock = window, clock
        self._rate = WallRate(hz)
        self._size = width_px, height_px
        self._images = rospy.Publisher(IMAGE.name, Image, queue_size=2)
        self._numbers = rospy.Publisher(NUMBERS.name, Int64MultiArray, queue_size=2)

    def poll(self) -> None:
        """Draws and publishes an image, if an image is due and a topic has subscribers."""
        if not self._rate.is_due():
            return
        start_s = time.monotonic()
        as_image, as_numbers = (topic.get_num_connections() > 0 for topic in (self._images, self._numbers))
        if not as_image and not as_numbers:
            return
        rgba = self._window.image(*self._size)
        if as_image:
            self._images.publish(self._message(rgba))
        if as_numbers:
            self._numbers.publish(_Numbers(rgba))
        self._rate.rest((time.monotonic() - start_s) * (1.0 / LARGEST_SHARE - 1.0))

    def _message(self, rgba: npt.NDArray[np.uint8]) -> Image:
        height, width, _ = rgba.shape
        message = Image(height=height, width=width, encoding="rgb8", step=3 * width)
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        message.data = rgba[..., :3].tobytes()
        return message


class _Numbers(Int64MultiArray):
    """Message with red, green, blue and alpha of each pixel.

    All numbers are serialised at once; rospy would serialise them one by one, which takes 0.1 s.
    """

    def __init__(self, rgba: npt.NDArray[np.uint8]) -> None:
        super().__init__()
        self._rgba = rgba

    def serialize(self, buff: IO[bytes]) -> None:
        """Writes an empty layout, the number of values, and the values."""
        buff.write(struct.pack("<III", 0, 0, self._rgba.size))
        buff.write(self._rgba.astype("<i8").tobytes())


class DebugCamera:
    """Publishes and sets the camera (the view) of PyBullet's window.

    Args:
        window: The window; without a window (None), the camera is neither published nor set.
        configured: Camera from the main YAML file, which `get` returns if there is no window.
    """

    def __init__(self, window: Window | None, configured: ResetDebugVisualizerCamera) -> None:
        self._window, self._configured = window, configured
        self._rate = WallRate(CAMERA_HZ)
        self._publisher = None if window is None else rospy.Publisher(CAMERA.name, CameraMessage, queue_size=10)

    def poll(self) -> None:
        """Publishes the window's camera, if a message is due and the topic has subscribers."""
        if self._window is None or self._publisher is None or not self._rate.is_due():
            return
        if self._publisher.get_num_connections():
            self._publisher.publish(_camera_message(self._window.camera()))

    def serve(self, ask: Requests) -> None:
        """Opens the service that returns the window's camera, and the topic that sets the window's camera."""
        self._ask = ask
        serve(GET, self)
        subscribe(RESET, self)

    def get(self, _: Any) -> CameraMessage:
        """Returns the window's camera; without a window, the configured camera."""
        window = self._window
        return _camera_message(self._configured if window is None else self._ask(window.camera))

    def reset(self, message: CameraMessage) -> None:
        """Sets the window's camera.

        Raises:
            InterfaceError: If there is no window.
            ValueError: If a value in the message is invalid.
        """
        given = {key: getattr(message, key) for key in ResetDebugVisualizerCamera.model_fields}
        try:
            camera = ResetDebugVisualizerCamera.parse(given, RESET.name)
        except ConfigError as error:
            raise ValueError("; ".join(f"{one.key}: {one.message}" for one in error.problems)) from None
        window = self._window
        if window is None:
            raise InterfaceError("there is no window (connection_mode: DIRECT)")
        self._ask(lambda: window.look(camera))


def _camera_message(camera: ResetDebugVisualizerCamera) -> CameraMessage:
    return CameraMessage(**camera.model_dump())


GET = Service("rpbi/get_debug_visualizer_camera", GetDebugVisualizerCamera, DebugCamera.get)
RESET = Topic(
    "rpbi/reset_debug_visualizer_camera",
    CameraMessage,
    DebugCamera.reset,
    "New view of the window.",
)


class WindowTopics:
    """Opens the configured topics of the window; without a window, logs which configured keys have no effect."""

    def __init__(self, world: World) -> None:
        self._camera = DebugCamera(world.window, world.config.resetDebugVisualizerCamera)
        self.polls: tuple[Callable[[], None], ...] = ()
        """To be called at every pass of the loop."""
        if world.window is None:
            _warn_of_idle_keys(world.config)
        else:
            self.polls = (self._camera.poll, *_open(world.window, world.config, world.clock))

    def serve(self, ask: Requests) -> None:
        """Opens the service and the topic of the window's camera; `ask` makes the simulation thread handle requests."""
        self._camera.serve(ask)


def _open(window: Window, config: WorldConfig, clock: Clock) -> Iterator[Callable[[], None]]:
    keyboard, mouse = config.enable_keyboard_publisher, config.enable_mouse_publisher
    if keyboard and not _asks_for_shortcuts(config):
        window.disable_shortcuts()
    if keyboard or mouse:
        yield GuiEvents(window, clock, keyboard, mouse).poll
    if config.publish_visualizer_image_hz:
        size = config.visualizer_image_width, config.visualizer_image_height
        yield VisualizerImage(window, clock, config.publish_visualizer_image_hz, *size).poll


def published_topics(config: WorldConfig) -> list[Topic]:
    """Returns the window topics that are published with a given configuration; an empty list without a window."""
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
