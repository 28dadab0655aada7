"""One connection to PyBullet."""

from __future__ import annotations

import ctypes
import logging
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from functools import partial, wraps
from typing import Any

import pybullet

from custom_ros_tools.errors import PhysicsError
from robot_model.geometry import Vector

WINDOWS = frozenset((pybullet.GUI, pybullet.GUI_SERVER, pybullet.GUI_MAIN_THREAD))
"""Modes in which PyBullet opens a window of its own; in others it is the server's, if there is one."""
MAXIMAL_COORDINATES = 1
"""PyBullet's type of bodies that the solver of rigid bodies moves, in `getDynamicsInfo`."""


PRINTING = frozenset(
    "resetSimulation loadURDF loadSDF loadMJCF loadSoftBody loadTexture loadPlugin createVisualShape "
    "createCollisionShape createMultiBody createSoftBodyAnchor createConstraint changeConstraint removeConstraint "
    "removeBody startStateLogging stopStateLogging vhacd".split()
)
"""Functions in which PyBullet may print; the others are called often, and never print."""
CHANGING = frozenset(
    "applyExternalForce applyExternalTorque changeConstraint changeDynamics createConstraint createMultiBody "
    "createSoftBodyAnchor loadBullet loadMJCF loadSDF loadSoftBody loadURDF performCollisionDetection removeBody "
    "removeConstraint resetBasePositionAndOrientation resetBaseVelocity resetJointState resetJointStateMultiDof "
    "resetJointStatesMultiDof resetMeshData resetSimulation restoreState setCollisionFilterGroupMask "
    "setCollisionFilterPair setGravity setJointMotorControl setJointMotorControl2 setJointMotorControlArray "
    "setJointMotorControlMultiDof setJointMotorControlMultiDofArray setPhysicsEngineParameter setRealTimeSimulation "
    "setTimeStep stepSimulation".split()
)
"""Functions that change the motion of a world."""
MAX_LINES = 20
"""Largest number of lines logged for one call; further ones are counted. PyBullet prints several for each link."""
log = logging.getLogger("pybullet")


class _Printed:
    """The lines that PyBullet prints while a call lasts, on their way to the log.

    It prints by C's `printf` and `fprintf`, to the streams that C's variables `stdout` and `stderr` name. These
    variables are changed, not the file descriptors 1 and 2: Python's own output, that of other threads too, is not
    affected.
    """

    def __init__(self) -> None:
        self._libc = ctypes.CDLL(None)
        self._libc.fdopen.restype = ctypes.c_void_p
        self._file = os.memfd_create("printed")
        self._stream = ctypes.c_void_p(self._libc.fdopen(self._file, b"w"))
        self._libc.setvbuf(self._stream, None, 2, 0)  # _IONBF of <stdio.h>
        self._streams = [ctypes.c_void_p.in_dll(self._libc, name) for name in ("stdout", "stderr")]
        self._originals = [stream.value for stream in self._streams]
        self._depth = 0
        self._lock = threading.RLock()

    @contextmanager
    def to_log(self) -> Iterator[None]:
        """Logs what is printed while the block runs, in this thread or, from within C, in others."""
        with self._lock:
            if not self._depth:
                self._originals = [stream.value for stream in self._streams]
                self._name(self._stream.value for _ in self._streams)
            self._depth += 1
        try:
            yield
        finally:
            with self._lock:
                self._depth -= 1
                if not self._depth:
                    self._name(self._originals)
                lines = self._drain()
            for line in lines[:MAX_LINES]:
                log.info("%s", line)
            if len(lines) > MAX_LINES:
                log.info("and %d more lines", len(lines) - MAX_LINES)

    def _name(self, streams: Iterable[int | None]) -> None:
        for variable, stream in zip(self._streams, streams):
            variable.value = stream

    def _drain(self) -> list[str]:
        size = os.fstat(self._file).st_size
        if not size:
            return []
        printed = os.pread(self._file, size, 0)
        os.ftruncate(self._file, 0)
        os.lseek(self._file, 0, os.SEEK_SET)
        return [line for line in printed.decode(errors="replace").splitlines() if line.strip()]


_printed = _Printed()


def _logged(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        with _printed.to_log():
            return function(*arguments, **options)

    return call


class ChangeWatch:
    """Notes calls that change a world by other means than its methods, which record their effect as commands.

    Attributes:
        recording: Number of such methods under way.
        unrecorded: The first of CHANGING that was called outside of them since the world was built or reset.
    """

    def __init__(self) -> None:
        self.recording = 0
        self.unrecorded = ""

    def watched(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Returns a function whose calls are noted."""

        def call(*arguments: Any, **options: Any) -> Any:
            if not self.recording and not self.unrecorded:
                self.unrecorded = name
            return function(*arguments, **options)

        return call


class Client:
    """PyBullet's functions and constants as attributes, bound to one connection.

    The binding is made once per function, since at a thousand ticks a second its cost would matter.

    Args:
        mode: PyBullet's connection mode, such as `pybullet.DIRECT`.
        options: Further arguments of `pybullet.connect`, for other modes than DIRECT, which has none.

    Raises:
        PhysicsError: If PyBullet does not connect, or a window is asked for and no screen answers.
    """

    def __init__(self, mode: int = pybullet.DIRECT, **options: Any) -> None:
        try:
            with _screen() if mode in WINDOWS else nullcontext(), _printed.to_log():
                self.client_id: int = pybullet.connect(mode, **(options if mode != pybullet.DIRECT else {}))
        except pybullet.error as error:
            raise PhysicsError(f"PyBullet did not connect: {error}") from error
        self.has_window = mode != pybullet.DIRECT
        self._window_prints = ExitStack()
        """The log of what PyBullet's window prints between calls, in a thread of its own."""
        self.is_deformable = False
        """Whether its world was set up for soft bodies."""
        self.gravity: Vector = (0.0, 0.0, 0.0)
        """Gravity of its world, as last set [m/s^2]."""
        self.sub_steps = 0
        """Sub-steps of each step of its world, as last set; 0 is one."""
        self.changes = ChangeWatch()
        """Calls that change its world."""
        self.advance: Callable[[], None] = partial(pybullet.stepSimulation, physicsClientId=self.client_id)
        """`stepSimulation` for the ticks of its world, which is not watched."""
        if self.client_id < 0:
            raise PhysicsError("PyBullet did not connect")
        if mode in WINDOWS:
            self._window_prints.enter_context(_printed.to_log())

    def disconnect(self) -> None:
        """Ends the connection.

        Raises:
            pybullet.error: If it has ended already.
        """
        with self._window_prints, _printed.to_log():
            pybullet.disconnect(self.client_id)

    def become(self, other: Client) -> None:
        """Takes over another connection and closes its own."""
        self.disconnect()
        values = {name: value for name, value in vars(other).items() if not callable(value)}
        kept = {"changes": self.changes, "advance": other.advance}
        vars(self).clear()
        vars(self).update(values | kept)

    def __getattr__(self, name: str) -> Any:
        value = getattr(pybullet, name)
        if callable(value):
            value = _logged(value) if name in PRINTING else value
            value = partial(value, physicsClientId=self.client_id)
            value = self.changes.watched(name, value) if name in CHANGING else value
        setattr(self, name, value)
        return value


@contextmanager
def _screen() -> Iterator[None]:
    """Holds a connection to the screen: without a screen, PyBullet would end the process.

    It is held until PyBullet has its own, since a virtual screen restarts when the last connection closes.

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
            f"'{os.getenv('DISPLAY', '')}': write DIRECT, or run it under xvfb-run, with a virtual screen"
        )
    try:
        yield
    finally:
        x11.XCloseDisplay(ctypes.c_void_p(display))
