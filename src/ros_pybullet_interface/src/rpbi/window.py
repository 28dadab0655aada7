"""PyBullet's own window: key events, mouse events, camera and image."""

import shutil
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pybullet

from custom_ros_tools.errors import MissingDependency
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera
from rpbi.engine.client import Client

RECORD = "--mp4="
"""Prefix of the option of `connect` that records a video of the window."""
MEASURED_CALLS = 10


class WindowKeyEvent(NamedTuple):
    """Event of a key in the window.

    Attributes:
        key: ASCII code of the key, or PyBullet's code if the key has no ASCII code.
        state: Sum of pybullet.KEY_IS_DOWN, KEY_WAS_TRIGGERED and KEY_WAS_RELEASED, as far as they apply.
    """

    key: int
    state: int


class MouseEvent(NamedTuple):
    """Event of the mouse in the window.

    Attributes:
        kind: 1 if the mouse moved, 2 if a button changed.
        x: Distance [px] of the pointer from the left edge of the window.
        y: Distance [px] of the pointer from the top edge of the window.
        button: 0 for left, 1 for middle, 2 for right; -1 if the mouse moved.
        state: State of the button, as in `WindowKeyEvent`; 0 if the mouse moved.
    """

    kind: int
    x: float
    y: float
    button: int
    state: int


class Window:
    """Reads events and images of a client's window, and controls the window's camera.

    Only the simulation thread may call the methods.

    Args:
        pb: The client.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        self._keys, self._buttons = ButtonHistory(), ButtonHistory()

    def disable_shortcuts(self) -> None:
        """Disables the keyboard shortcuts of the window, such as `i` to pause it. Escape still closes the window."""
        self._pb.configureDebugVisualizer(pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS, 0)

    def key_events(self) -> Iterator[WindowKeyEvent]:
        """Yields key events since the last call, and one event for each key that is held."""
        for key, state in self._pb.getKeyboardEvents().items():
            if key >= 0:  # PyBullet reports all keys without a code as -1
                for happened in self._keys.observe(key, state):
                    yield WindowKeyEvent(key, happened)

    def mouse_events(self) -> Iterator[MouseEvent]:
        """Yields mouse events since the last call."""
        for kind, x, y, button, state in self._pb.getMouseEvents():
            if button < 0:
                yield MouseEvent(kind, x, y, button, 0)
            else:
                for happened in self._buttons.observe(button, state):
                    yield MouseEvent(kind, x, y, button, happened)

    def camera(self) -> ResetDebugVisualizerCamera:
        """Returns the present camera of the window, which the user may have moved with the mouse."""
        found = self._pb.getDebugVisualizerCamera()
        yaw, pitch, distance, target = found[8:12]
        return ResetDebugVisualizerCamera.model_construct(
            cameraDistance=distance, cameraYaw=yaw, cameraPitch=pitch, cameraTargetPosition=target
        )

    def look(self, camera: ResetDebugVisualizerCamera) -> None:
        """Sets the camera of the window."""
        self._pb.resetDebugVisualizerCamera(**camera.kwargs())

    def seconds_per_call(self) -> float:
        """Measures the mean duration [s] of a PyBullet call, including the wait for the frame that the window draws."""
        begin_s = time.monotonic()
        for _ in range(MEASURED_CALLS):
            self._pb.getPhysicsEngineParameters()
        return (time.monotonic() - begin_s) / MEASURED_CALLS

    def image(self, width_px: int, height_px: int) -> npt.NDArray[np.uint8]:
        """Renders the window's view as an image with the same vertical field of view; the world does not advance.

        Args:
            width_px: Width of the image [px].
            height_px: Height of the image [px].

        Returns:
            Red, green, blue and alpha, shape (height, width, 4).
        """
        found = self._pb.getDebugVisualizerCamera()
        projection = list(found[3])
        projection[0] = (
            projection[5] * height_px / width_px
        )  # otherwise it would show the window's whole width, squeezed
        image = self._pb.getCameraImage(
            width_px,
            height_px,
            found[2],
            projection,
            renderer=pybullet.ER_BULLET_HARDWARE_OPENGL,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
        )
        return np.asarray(image[2], np.uint8).reshape(height_px, width_px, 4)


def check_recording(options: str) -> None:
    """Checks that ffmpeg is available if the options request a video of the window.

    Args:
        options: The argument `options` of `pybullet.connect`.

    Raises:
        MissingDependency: If ffmpeg is missing. PyBullet would not report this.
    """
    if RECORD in options and shutil.which("ffmpeg") is None:
        raise MissingDependency("ffmpeg", f"connect.options {RECORD} needs it: apt-get install ffmpeg")


DOWN: int = pybullet.KEY_IS_DOWN
TRIGGERED: int = pybullet.KEY_WAS_TRIGGERED
RELEASED: int = pybullet.KEY_WAS_RELEASED
PRESSED = DOWN | TRIGGERED


class ButtonHistory:
    """Reconstructs the presses and releases of keys or mouse buttons from PyBullet's reports.

    PyBullet reports only the last event between two frames of the window. A short tap is reported as a release only; a
    release followed by a press is reported as a press only. Since presses and releases alternate, the previous state of
    the button shows which events are missing.
    """

    def __init__(self) -> None:
        self._held: set[int] = set()

    def observe(self, button: int, state: int) -> list[int]:
        """Returns the events of a button since the last call, in order of time.

        Args:
            button: Code of the key or mouse button.
            state: State that PyBullet reports: a sum of DOWN, TRIGGERED and RELEASED.

        Returns:
            Events, each PRESSED, RELEASED, or DOWN if the button is still held.
        """
        was_held, is_held = button in self._held, bool(state & DOWN)
        (self._held.add if is_held else self._held.discard)(button)
        if state & TRIGGERED:
            happened = [RELEASED, PRESSED] if was_held else [PRESSED]
            if state & RELEASED and not (was_held and is_held):
                happened += [RELEASED, PRESSED] if is_held else [RELEASED]
            return happened
        if state & RELEASED:
            return [RELEASED] if was_held else [PRESSED, RELEASED]
        return [DOWN] if is_held else []
