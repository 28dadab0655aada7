"""Messages between the simulator and the renderer process, and a non-blocking connection for them.

The docstring of each message names the receiver.
"""

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
    """To the renderer, as the first message: the initial cameras, and whether to try the EGL renderer."""

    cameras: tuple[Camera, ...]
    use_egl: bool


class CameraAdded(NamedTuple):
    """To the renderer: a camera was added."""

    camera: Camera


class CameraRemoved(NamedTuple):
    """To the renderer: the camera with this name was removed."""

    name: str


class WorldChanged(NamedTuple):
    """Message to the renderer with the entries of the world's load log that were added since the last such message."""

    entries: tuple[LogEntry, ...]


class DrawnScene(NamedTuple):
    """To the renderer: a scene to draw.

    Attributes:
        sample: States of all bodies and pose of the camera at one tick.
        body_ids: PyBullet's body ids in the simulator, indexed by name, for the segmentation image.
    """

    sample: SceneSample
    body_ids: Mapping[str, int]


class Ready(NamedTuple):
    """To the simulator: the renderer is ready; its name is `EGL (DRIVER)` or `TinyRenderer`."""

    renderer: str


class Alive(NamedTuple):
    """To the simulator: the renderer process is running; sent twice a second, except while a frame is drawn."""


class SceneAccepted(NamedTuple):
    """To the simulator: the renderer starts to draw the scene of this camera, and can receive the next scene."""

    camera: str


class Shown(NamedTuple):
    """To the simulator: the frame of a synchronous camera was passed to the sink, or skipped for lack of viewers.

    Attributes:
        camera: Name of the camera.
        stamp_ns: Stamp of the frame [ns].
    """

    camera: str
    stamp_ns: int


class Demanded(NamedTuple):
    """To the simulator: the demand for each camera's images, indexed by camera name; sent when a demand changes."""

    demands: Mapping[str, Demand]


class Report(NamedTuple):
    """To the simulator: a message for the simulator's log, with a level of the module `logging`."""

    level: int
    text: str


_LENGTH = struct.Struct("<I")
_CHUNK = 1 << 18


class Channel:
    """Sends and receives picklable objects over a connected stream socket, without blocking.

    The channel sends an object's length before the object. Data that the socket does not accept yet is buffered without
    limit, so the caller must limit the amount. Only one thread may use a channel.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._outgoing = bytearray()
        self._incoming = bytearray()
        self.closed = False
        """Whether the other side has gone."""

    def send(self, item: Any) -> None:
        """Sends an object; data that the socket does not accept now is sent by a later `flush`."""
        data = pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL)
        self._outgoing += _LENGTH.pack(len(data))
        self._outgoing += data
        self.flush()

    def flush(self) -> None:
        """Sends as much buffered data as the socket accepts now."""
        try:
            while self._outgoing and not self.closed:
                del self._outgoing[: self._socket.send(self._outgoing)]
        except BlockingIOError:
            pass
        except OSError:
            self.closed = True

    def receive(self) -> list[Any]:
        """Returns the objects that have arrived since the last call."""
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
        """Waits until data has arrived, or buffered data can be sent.

        Args:
            timeout_s: Longest wait [s]; None waits without limit.
        """
        if not self.closed:
            select.select([self._socket], [self._socket] if self._outgoing else [], [], timeout_s)

    def close(self) -> None:
        """Closes the connection, which the other side notices."""
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
