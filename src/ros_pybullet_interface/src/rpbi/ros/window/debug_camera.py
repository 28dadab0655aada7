"""Camera of PyBullet's window: published, returned and changed."""

from typing import Any

import rospy

from custom_ros_tools.errors import ConfigError, InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import WallRate
from ros_pybullet_interface.msg import ResetDebugVisualizerCamera as CameraMessage
from ros_pybullet_interface.srv import GetDebugVisualizerCamera
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera
from rpbi.ros.endpoints import Service, Topic, serve, subscribe
from rpbi.ros.requests import Requests
from rpbi.window import Window

CAMERA = Topic("rpbi/debug_visualizer_camera", CameraMessage, meaning="Where the window looks from now; 30 Hz.")
HZ = 30.0


class DebugCamera:
    """Publishes the camera of the window while it has subscribers.

    Args:
        window: The window; without it, nothing is published, and nothing can be changed.
        configured: The initial camera of a window.
    """

    def __init__(self, window: Window | None, configured: ResetDebugVisualizerCamera) -> None:
        self._window, self._configured = window, configured
        self._rate = WallRate(HZ)
        self._publisher = None if window is None else rospy.Publisher(CAMERA.name, CameraMessage, queue_size=10)

    def poll(self) -> None:
        """Publishes it if it is due."""
        if self._window is None or self._publisher is None or not self._rate.is_due():
            return
        if self._publisher.get_num_connections():
            self._publisher.publish(_message(self._window.camera()))

    def serve(self, ask: Requests) -> None:
        """Opens the service that returns it and the topic that changes it."""
        self._ask = ask
        serve(GET, self)
        subscribe(RESET, self)

    def get(self, _: Any) -> CameraMessage:
        """Returns the camera of the window; without a window, the configured one."""
        window = self._window
        return _message(self._configured if window is None else self._ask(window.camera))

    def reset(self, message: CameraMessage) -> None:
        """Moves the camera of the window.

        Raises:
            InterfaceError: If there is no window.
            ValueError: If the message is not sound.
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


def _message(camera: ResetDebugVisualizerCamera) -> CameraMessage:
    return CameraMessage(**camera.model_dump())


GET = Service("rpbi/get_debug_visualizer_camera", GetDebugVisualizerCamera, DebugCamera.get)
RESET = Topic(
    "rpbi/reset_debug_visualizer_camera",
    CameraMessage,
    DebugCamera.reset,
    "Where the window is to look from.",
)
