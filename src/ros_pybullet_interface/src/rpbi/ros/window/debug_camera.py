"""From where PyBullet's window looks: told, asked for and changed."""

from __future__ import annotations

import time

import rospy

from custom_ros_tools.errors import ConfigError, InterfaceError
from custom_ros_tools.ros.lifecycle.throttle import ThrottledWarning
from ros_pybullet_interface.msg import ResetDebugVisualizerCamera as CameraMessage
from ros_pybullet_interface.srv import (
    GetDebugVisualizerCamera,
    GetDebugVisualizerCameraRequest,
    GetDebugVisualizerCameraResponse,
)
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera
from rpbi.ros.requests import Requests
from rpbi.window import Window

CAMERA_TOPIC = "rpbi/debug_visualizer_camera"
RESET_TOPIC = "rpbi/reset_debug_visualizer_camera"
GET_SERVICE = "rpbi/get_debug_visualizer_camera"
PERIOD_S = 1.0 / 30.0


class DebugCamera:
    """Publishes where the window looks from while somebody listens.

    Args:
        window: The window, None if there is none; then what is asked is answered by that.
    """

    def __init__(self, window: Window | None) -> None:
        self._window = window
        self._due_s = 0.0
        self._warn = ThrottledWarning()
        self._publisher = None if window is None else rospy.Publisher(CAMERA_TOPIC, CameraMessage, queue_size=10)

    def poll(self) -> None:
        """Tells it if it is time to."""
        now_s = time.monotonic()
        if self._window is None or self._publisher is None or now_s < self._due_s:
            return
        self._due_s = max(self._due_s + PERIOD_S, now_s)
        if self._publisher.get_num_connections():
            self._publisher.publish(_message(self._window.camera()))

    def serve(self, ask: Requests) -> None:
        """Opens the service that tells it and the topic that changes it.

        Args:
            ask: Reaches the simulation thread.
        """
        self._ask = ask
        rospy.Service(GET_SERVICE, GetDebugVisualizerCamera, self._get)
        rospy.Subscriber(RESET_TOPIC, CameraMessage, self._reset, queue_size=1, tcp_nodelay=True)

    def _get(self, _: GetDebugVisualizerCameraRequest) -> GetDebugVisualizerCameraResponse:
        camera = self._ask.or_service_error(lambda: self._present_window().camera())
        return GetDebugVisualizerCameraResponse(_message(camera))

    def _reset(self, message: CameraMessage) -> None:
        topic = rospy.resolve_name(RESET_TOPIC)
        given = {key: getattr(message, key) for key in ResetDebugVisualizerCamera.model_fields}
        try:
            camera = ResetDebugVisualizerCamera.parse(given, topic)
            self._ask(lambda: self._present_window().look(camera))
        except ConfigError as error:
            self._warn(topic, "message refused: " + "; ".join(f"{one.key}: {one.message}" for one in error.problems))
        except InterfaceError as error:
            self._warn(topic, f"message refused: {error}")

    def _present_window(self) -> Window:
        if self._window is None:
            raise InterfaceError("there is no window (connection_mode: DIRECT)")
        return self._window


def _message(camera: ResetDebugVisualizerCamera) -> CameraMessage:
    return CameraMessage(**camera.model_dump())
