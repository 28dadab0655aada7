"""One connection to PyBullet."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any

import pybullet

from custom_ros_tools.errors import PhysicsError
from rpbi.geometry import Vector

WINDOWS = frozenset((pybullet.GUI, pybullet.GUI_SERVER, pybullet.GUI_MAIN_THREAD))
"""Modes in which PyBullet opens a window of its own; in others it is the server's, if there is one."""
MAXIMAL_COORDINATES = 1
"""PyBullet's type of bodies that the solver of rigid bodies moves, in `getDynamicsInfo`."""


class Client:
    """PyBullet's functions and constants as attributes, bound to one connection.

    The binding is made once per function: at a thousand ticks a second, making it at every call would show.

    Args:
        mode: PyBullet's connection mode, such as `pybullet.DIRECT`.
        options: Further arguments of `pybullet.connect`, for other modes than DIRECT, which takes none.

    Raises:
        PhysicsError: If PyBullet does not connect, or a window is asked for and no screen answers.
    """

    def __init__(self, mode: int = pybullet.DIRECT, **options: Any) -> None:
        try:
            with _screen() if mode in WINDOWS else nullcontext():
                self.client_id: int = pybullet.connect(mode, **(options if mode != pybullet.DIRECT else {}))
        except pybullet.error as error:
            raise PhysicsError(f"PyBullet did not connect: {error}") from error
        self.has_window = mode != pybullet.DIRECT
        self.is_deformable = False
        """Whether soft bodies can be in its world, as told when that was set up."""
        self.gravity: Vector = (0.0, 0.0, 0.0)
        """Gravity of its world [m/s^2], as told when that was set."""
        self.sub_steps = 0
        """Parts that each step of its world is divided into, as told when that was set; 0 is one."""
        if self.client_id < 0:
            raise PhysicsError("PyBullet did not connect")

    def __getattr__(self, name: str) -> Any:
        value = getattr(pybullet, name)
        if callable(value):
            value = partial(value, physicsClientId=self.client_id)
        setattr(self, name, value)
        return value


@contextmanager
def _screen() -> Iterator[None]:
    """Holds a connection to the screen: without one, PyBullet would end the process, with words of its own alone.

    It is held until PyBullet has its own, for a virtual screen starts anew when the last connection goes.

    Raises:
        PhysicsError: If no screen answers.
    """
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError as error:
        raise PhysicsError(f"a window of PyBullet needs X11: {error}") from error
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if display is None:
        raise PhysicsError(
            "connect.connection_mode: a window needs a screen, and none answers at DISPLAY "
            f"'{os.getenv('DISPLAY', '')}': write DIRECT, or run it under xvfb-run, with a screen that nobody sees"
        )
    try:
        yield
    finally:
        x11.XCloseDisplay(ctypes.c_void_p(display))
