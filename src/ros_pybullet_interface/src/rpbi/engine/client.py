"""A connection to PyBullet that logs PyBullet's output and detects unrecorded changes of the world."""

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
"""Connection modes in which this process opens PyBullet's window; in other modes only a server may have a window."""
MAXIMAL_COORDINATES = 1
"""Body type in `getDynamicsInfo` of bodies that PyBullet's rigid-body solver moves, not its multibody solver."""


PRINTING = frozenset(
    "resetSimulation loadURDF loadSDF loadMJCF loadSoftBody loadTexture loadPlugin createVisualShape "
    "createCollisionShape createMultiBody createSoftBodyAnchor createConstraint changeConstraint removeConstraint "
    "removeBody startStateLogging stopStateLogging vhacd".split()
)
"""PyBullet functions whose output is logged. Other functions are called often and never print."""
CHANGING = frozenset(
    "applyExternalForce applyExternalTorque changeConstraint changeDynamics createConstraint createMultiBody "
    "createSoftBodyAnchor loadBullet loadMJCF loadSDF loadSoftBody loadURDF performCollisionDetection removeBody "
    "removeConstraint resetBasePositionAndOrientation resetBaseVelocity resetJointState resetJointStateMultiDof "
    "resetJointStatesMultiDof resetMeshData resetSimulation restoreState setCollisionFilterGroupMask "
    "setCollisionFilterPair setGravity setJointMotorControl setJointMotorControl2 setJointMotorControlArray "
    "setJointMotorControlMultiDof setJointMotorControlMultiDofArray setPhysicsEngineParameter setRealTimeSimulation "
    "setTimeStep stepSimulation".split()
)
"""PyBullet functions that change the motion of a world."""
MAX_LINES = 20
"""Largest number of lines that are logged for one call; further lines are counted. PyBullet prints several per link."""
log = logging.getLogger("pybullet")


class _Printed:
    """Redirects PyBullet's printed output to the log.

    PyBullet prints to C's `stdout` and `stderr`. While output is redirected, these two C variables refer to a file in
    memory. File descriptors 1 and 2 do not change, so the output of Python code in any thread is not affected.
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
        """Redirects C output of the whole process during a `with` block, and logs the printed lines at the block's end.

        Blocks of several threads may overlap or be nested. The last block to end restores C's streams.
        """
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
    """Detects calls of PyBullet functions that change a world but are not recorded as commands.

    The methods of a world record their changes as commands. A direct call of a function in `CHANGING` is not recorded.

    Attributes:
        recording: Number of running methods that record their own changes as commands.
        unrecorded: Name of the first function in `CHANGING` that was called while `recording` was 0, since the world
            was built or reset; empty if there was no such call.
    """

    def __init__(self) -> None:
        self.recording = 0
        self.unrecorded = ""

    def watched(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wraps a PyBullet function so that the first call while `recording` is 0 sets `unrecorded` to `name`."""

        def call(*arguments: Any, **options: Any) -> Any:
            if not self.recording and not self.unrecorded:
                self.unrecorded = name
            return function(*arguments, **options)

        return call


class Client:
    """Provides PyBullet's functions and constants as attributes, bound to one connection.

    Each function is bound at its first use and then kept, since binding at every call would be slow.

    Args:
        mode: PyBullet's connection mode, such as `pybullet.DIRECT`.
        options: Further arguments of `pybullet.connect`; ignored in mode DIRECT.

    Raises:
        PhysicsError: If PyBullet does not connect, or if the mode needs a window and there is no screen.
    """

    def __init__(self, mode: int = pybullet.DIRECT, **options: Any) -> None:
        try:
            with _screen() if mode in WINDOWS else nullcontext(), _printed.to_log():
                self.client_id: int = pybullet.connect(mode, **(options if mode != pybullet.DIRECT else {}))
        except pybullet.error as error:
            raise PhysicsError(f"PyBullet did not connect: {error}") from error
        self.has_window = mode != pybullet.DIRECT
        self._window_prints = ExitStack()
        """Redirects the output of the window's own thread to the log, until `disconnect`."""
        self.is_deformable = False
        """Whether the world was set up for soft bodies."""
        self.gravity: Vector = (0.0, 0.0, 0.0)
        """Gravity of the world, as last set [m/s^2]."""
        self.sub_steps = 0
        """Number of sub-steps per step of the world, as last set; 0 means one sub-step."""
        self.changes = ChangeWatch()
        """Watches calls that change the world."""
        self.advance: Callable[[], None] = partial(pybullet.stepSimulation, physicsClientId=self.client_id)
        """`stepSimulation` for the ticks of the world; `changes` does not watch these calls."""
        if self.client_id < 0:
            raise PhysicsError("PyBullet did not connect")
        if mode in WINDOWS:
            self._window_prints.enter_context(_printed.to_log())

    def disconnect(self) -> None:
        """Ends the connection.

        Raises:
            pybullet.error: If the connection has ended already.
        """
        with self._window_prints, _printed.to_log():
            pybullet.disconnect(self.client_id)

    def become(self, other: Client) -> None:
        """Closes this client's connection, and takes over the connection of another client."""
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
    """Checks that there is an X11 screen, and holds a connection to the screen during a `with` block.

    Without a screen, PyBullet would end the process. The connection is held until PyBullet has connected, since a
    virtual screen restarts when the last connection to the screen closes.

    Raises:
        PhysicsError: If there is no screen.
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
