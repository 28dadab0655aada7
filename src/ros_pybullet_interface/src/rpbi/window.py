"""PyBullet's own window: keys, mouse, camera, image."""

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
"""Beginning of the option of `connect` that records the window."""
MEASURED_CALLS = 10


class WindowKeyEvent(NamedTuple):
    """Event of a key.

    Attributes:
        key: ASCII code, or PyBullet's code of a key without one.
        state: Sum of pybullet.KEY_IS_DOWN, KEY_WAS_TRIGGERED and KEY_WAS_RELEASED.
    """

    key: int
    state: int


class MouseEvent(NamedTuple):
    """Event of the mouse.

    Attributes:
        kind: 1 it moved, 2 a button changed.
        x: From the left edge of the window [px].
        y: From its top edge [px].
        button: 0 left, 1 middle, 2 right; -1 on a move.
        state: State of the button, as for a key.
    """

    kind: int
    x: float
    y: float
    button: int
    state: int


class Window:
    """The window of a client, if it has one; only the simulation thread may use it.

    Args:
        pb: The client.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        self._keys, self._buttons = ButtonHistory(), ButtonHistory()

    def disable_shortcuts(self) -> None:
        """Disables the keys of the window itself, such as `i`, which pauses it; Escape still closes it."""
        self._pb.configureDebugVisualizer(pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS, 0)

    def key_events(self) -> Iterator[WindowKeyEvent]:
        """Yields key events since the last call, and one for each key that is held; a call takes half a microsecond."""
        for key, state in self._pb.getKeyboardEvents().items():
            if key >= 0:  # PyBullet reports all keys without a code as -1
                for happened in self._keys.observe(key, state):
                    yield WindowKeyEvent(key, happened)

    def mouse_events(self) -> Iterator[MouseEvent]:
        """Yields events of the mouse since the last call."""
        for kind, x, y, button, state in self._pb.getMouseEvents():
            if button < 0:
                yield MouseEvent(kind, x, y, button, 0)
            else:
                for happened in self._buttons.observe(button, state):
                    yield MouseEvent(kind, x, y, button, happened)

    def camera(self) -> ResetDebugVisualizerCamera:
        """Returns the present view of the window, which the mouse may have changed."""
        found = self._pb.getDebugVisualizerCamera()
        yaw, pitch, distance, target = found[8:12]
        return ResetDebugVisualizerCamera.model_construct(
            cameraDistance=distance, cameraYaw=yaw, cameraPitch=pitch, cameraTargetPosition=target
        )

    def look(self, camera: ResetDebugVisualizerCamera) -> None:
        """Sets the view of the window."""
        self._pb.resetDebugVisualizerCamera(**camera.kwargs())

    def seconds_per_call(self) -> float:
        """Returns the present duration of a call of PyBullet, answered between two frames of the window [s]."""
        begin_s = time.monotonic()
        for _ in range(MEASURED_CALLS):
            self._pb.getPhysicsEngineParameters()
        return (time.monotonic() - begin_s) / MEASURED_CALLS

    def image(self, width_px: int, height_px: int) -> npt.NDArray[np.uint8]:
        """Returns the view of the window, drawn again in another size with the same vertical opening.

        The world does not advance meanwhile.

        Returns:
            Colours red, green, blue, alpha; shape (height, width, 4).
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
    """Checks that a requested video of the window can be recorded.

    Args:
        options: The options of `connect`.

    Raises:
        MissingDependency: If ffmpeg is missing, which PyBullet does not report.
    """
    if RECORD in options and shutil.which("ffmpeg") is None:
        raise MissingDependency("ffmpeg", f"connect.options {RECORD} needs it: apt-get install ffmpeg")


DOWN: int = pybullet.KEY_IS_DOWN
TRIGGERED: int = pybullet.KEY_WAS_TRIGGERED
RELEASED: int = pybullet.KEY_WAS_RELEASED
PRESSED = DOWN | TRIGGERED


class ButtonHistory:
    """Splits PyBullet's state of a button, which may hold both a press and a release.

    PyBullet reports only the last event between two frames of the window: a short tap as a release, a release and a new
    press as a press. The previous state separates them: presses and releases always alternate.
    """

    def __init__(self) -> None:
        self._held: set[int] = set()

    def observe(self, button: int, state: int) -> list[int]:
        """Returns the events of a button since the last call, in order.

        Args:
            button: Its code.
            state: Sum of DOWN, TRIGGERED and RELEASED.

        Returns:
            PRESSED, DOWN (held) or RELEASED each.
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
