"""Messages between simulator and renderer process, and the connection that carries them without waiting."""

import pickle
import select
import socket
import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

from rpbi.samples import SceneSample
from rpbi.world.load_log import LogEntry

from .frame import Camera, Demand


class SetUp(NamedTuple):
    """To the renderer, first of all: the cameras, and whether to try the fast renderer."""

    cameras: tuple[Camera, ...]
    use_egl: bool


class CameraAdded(NamedTuple):
    """To the renderer: there is another camera."""

    camera: Camera


class CameraRemoved(NamedTuple):
    """To the renderer: a camera has gone."""

    name: str


class WorldChanged(NamedTuple):
    """To the renderer: changes of the world since the last message."""

    entries: tuple[LogEntry, ...]


class DrawnScene(NamedTuple):
    """To the renderer: a tick to draw.

    Attributes:
        sample: Where everything is.
        body_ids: PyBullet's ids in the simulator by name, for the segmentation.
    """

    sample: SceneSample
    body_ids: Mapping[str, int]


class Ready(NamedTuple):
    """To the simulator: name of the renderer, `EGL` or `TinyRenderer`, with details."""

    renderer: str


class Alive(NamedTuple):
    """To the simulator: the renderer works; twice a second, unless a frame takes longer."""


class SceneAccepted(NamedTuple):
    """To the simulator: the scene of this camera is being drawn, the next one may come."""

    camera: str


class Shown(NamedTuple):
    """To the simulator: the frame of a synchronous camera was passed to the sink, or has no viewers.

    Attributes:
        camera: The camera.
        stamp_ns: Stamp of the frame [ns].
    """

    camera: str
    stamp_ns: int


class Demanded(NamedTuple):
    """To the simulator: demands by camera."""

    demands: Mapping[str, Demand]


class Report(NamedTuple):
    """To the simulator: something for its log, at a level of `logging`."""

    level: int
    text: str


_LENGTH = struct.Struct("<I")
_CHUNK = 1 << 18


class Channel:
    """Sends and receives picklable objects over a connected stream socket, each with its length before it.

    Data that the other side has not received yet waits here; the sender has to bound it. It is for one thread.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._outgoing = bytearray()
        self._incoming = bytearray()
        self.closed = False
        """Whether the other side has gone."""

    def send(self, item: Any) -> None:
        """Sends an object, now or by a later `flush`."""
        data = pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL)
        self._outgoing += _LENGTH.pack(len(data))
        self._outgoing += data
        self.flush()

    def flush(self) -> None:
        """Sends waiting data as far as the socket accepts it now."""
        try:
            while self._outgoing and not self.closed:
                del self._outgoing[: self._socket.send(self._outgoing)]
        except BlockingIOError:
            pass
        except OSError:
            self.closed = True

    def receive(self) -> list[Any]:
        """Returns the objects that have come since the last time."""
        try:
            while not self.closed:
                data = self._socket.recv(_CHUNK)
                self._incoming += data
                self.closed = not data
        except BlockingIOError:
            pass
        except OSError:
            self.closed = True
        return self._pop_complete() if self._incoming else []

    def wait(self, timeout_s: float | None) -> None:
        """Waits until there is something to receive, or to send on, up to a time [s]."""
        if not self.closed:
            select.select([self._socket], [self._socket] if self._outgoing else [], [], timeout_s)

    def close(self) -> None:
        """Ends the connection; the other side sees it."""
        self.closed = True
        self._socket.close()

    def _pop_complete(self) -> list[Any]:
        items = []
        begin = 0
        while len(self._incoming) - begin >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._incoming, begin)
            end = begin + _LENGTH.size + length
            if end > len(self._incoming):
                break
            items.append(pickle.loads(memoryview(self._incoming)[begin + _LENGTH.size : end]))
            begin = end
        del self._incoming[:begin]
        return items
