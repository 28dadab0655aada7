"""Receives a stream of MVN by UDP, and decodes, checks, calibrates and records the stream."""

import contextlib
import select
import socket
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel, Positive, Seconds, Switch, Text

from .checks import Finding, FrameChecks
from .orientations import Calibration
from .packets import DEFAULT_PORT
from .recording import DatagramRecording
from .segments import SegmentFrame
from .stream import StreamDecoder

MAX_DATAGRAMS = 64
"""Largest number of datagrams that one call reads before it returns the events."""
MAX_DATAGRAM_BYTES = 65_535
BUFFER_BYTES = 1 << 20
REMARK_PERIOD_S = 1.0


class MvnConfig(ConfigModel):
    """Address and time-out of the stream from MVN, and the units and axes of its positions."""

    host: Text = Field(
        "127.0.0.1", description="Address at which the receiver listens; 0.0.0.0 also receives from other computers."
    )
    port: int = Field(DEFAULT_PORT, ge=0, le=65_535, description="UDP port; 0 selects any free port.")
    position_scale: Positive = Field(
        1.0, description="Factor from received positions to metres; messages of type 01 are not scaled."
    )
    y_up: Switch = Field(False, description="Whether the y axis points up in messages of type 02.")
    max_people: int = Field(
        8, ge=1, le=256, description="Largest number of people; frames of further people are refused."
    )
    timeout_s: Seconds = Field(0.5, description="Time without a frame after which the stream counts as lost.")


class Silence(NamedTuple):
    """Event: no frame of a person has arrived for `seconds` [s]. Reported once per silence."""

    person: int
    seconds: float


class Refused(NamedTuple):
    """Event: a datagram was refused. `reason` is a key of `packets.REASONS`."""

    reason: str


class Receiver:
    """Receives datagrams by a socket, and converts them to events.

    The same thread must call `open`, `poll` and `close`. Other threads may calibrate and record at the same time.
    """

    def __init__(self, config: MvnConfig) -> None:
        self.config = config
        self.calibration = Calibration()
        self._decoder = StreamDecoder(config.position_scale, bool(config.y_up), config.max_people)
        self._checks: dict[int, FrameChecks] = {}
        self._newest: dict[int, tuple[float, SegmentFrame]] = {}
        """Arrival [s] and uncalibrated value of each present person's newest frame, keyed by the person's number."""
        self._socket: socket.socket | None = None
        self._remarks_due_s = 0.0
        self._lock = threading.Lock()
        self._recording: DatagramRecording | None = None

    @property
    def counts(self) -> Counter[str]:
        """Number of datagrams, keyed by result, see `StreamDecoder`."""
        return self._decoder.counts

    @property
    def refusals(self) -> dict[str, str]:
        """For each reason, details of the newest datagram that was refused for this reason."""
        return self._decoder.refusals

    @property
    def people(self) -> list[int]:
        """Numbers of the people whose frames are arriving, sorted."""
        return sorted(self._newest.copy())

    @property
    def port(self) -> int:
        """The UDP port in use; 0 while the socket is closed."""
        return int(self._socket.getsockname()[1]) if self._socket else 0

    def open(self) -> None:
        """Starts to listen for datagrams.

        Raises:
            OSError: If the address or the port is not available.
        """
        self.close()
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            receiver.setblocking(False)
            receiver.bind((self.config.host, self.config.port))
        except OSError:
            receiver.close()
            raise
        self._socket = receiver

    def close(self) -> None:
        """Stops listening, resets the stream, and ends a recording."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        with contextlib.suppress(InterfaceError):  # usually none is running
            self.stop_recording()
        self._forget()

    def poll(self, timeout_s: float) -> list[Any]:
        """Waits for datagrams, and returns the new events; an empty list after the timeout.

        Events are messages of MVN, `Finding`, `Refused` and `Silence`.

        Args:
            timeout_s: Longest time to wait [s].
        """
        assert self._socket is not None, "it is not open"
        end_s = time.monotonic() + timeout_s
        while True:
            left_s = max(end_s - time.monotonic(), 0.0)
            if self._newest:
                oldest_s = min(came_s for came_s, _ in self._newest.values())
                left_s = min(left_s, max(oldest_s + self.config.timeout_s - time.monotonic(), 0.0))
            select.select([self._socket], [], [], left_s)
            events = self._drain() + self._silence() + self._remarks()
            if events or time.monotonic() >= end_s:
                return events

    def _drain(self) -> list[Any]:
        assert self._socket is not None
        events: list[Any] = []
        for _ in range(MAX_DATAGRAMS):
            try:
                data = self._socket.recv(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            now_s = time.monotonic()
            events += self._record(now_s, data)
            message = self._decoder.decode(data)
            if isinstance(message, SegmentFrame):
                self._newest[message.person] = now_s, message
                checks = self._checks.setdefault(message.person, FrameChecks())
                events += _of_person(message.person, checks.check(message, now_s))
                message = self.calibration.apply(message)
            if message is not None:
                events.append(message)
        events += map(Refused, self._decoder.refused)
        self._decoder.refused.clear()
        return events

    def _silence(self) -> list[Silence]:
        last_s = time.monotonic() - self.config.timeout_s
        gone = [person for person, (came_s, _) in list(self._newest.items()) if came_s <= last_s]
        for person in gone:
            del self._newest[person]
            del self._checks[person]
        if gone and not self._newest:
            self._decoder.reset()
        return [Silence(person, self.config.timeout_s) for person in gone]

    def _forget(self) -> None:
        self._decoder.reset()
        self._checks.clear()
        self._newest.clear()

    def _remarks(self) -> list[Finding]:
        now_s = time.monotonic()
        if not self._decoder.remarks or now_s < self._remarks_due_s:
            return []
        self._remarks_due_s = now_s + REMARK_PERIOD_S
        found = [Finding(subject, message) for subject, message in self._decoder.remarks.items()]
        self._decoder.remarks.clear()
        return found

    # --- Methods for other threads.

    def calibrate(self) -> str:
        """Calibrates all present people, with their present poses as T-poses. Returns a summary for the user.

        Raises:
            InterfaceError: If no person is present, or a pose is not a T-pose. The offsets of the person in question
                then stay unchanged.
        """
        newest = self._newest.copy()
        if not newest:
            raise InterfaceError("no person is present: no recent frame")
        return "; ".join(self.calibration.fit(frame) for _, frame in newest.values())

    def start_recording(self, path: Path) -> None:
        """Starts to record datagrams into a new file.

        Raises:
            InterfaceError: If a recording is running already, or the file cannot be created.
        """
        with self._lock:
            if self._recording is not None:
                raise InterfaceError(f"{self._recording.path} is being recorded already")
            self._recording = DatagramRecording(path)

    def stop_recording(self) -> tuple[Path, int]:
        """Ends the recording. Returns the path of the file and the number of recorded datagrams.

        Raises:
            InterfaceError: If no recording is running, or the remaining data cannot be written.
        """
        with self._lock:
            recording, self._recording = self._recording, None
        if recording is None:
            raise InterfaceError("nothing is being recorded")
        recording.close()
        return recording.path, recording.count

    def _record(self, now_s: float, data: bytes) -> list[Finding]:
        with self._lock:
            if self._recording is None:
                return []
            try:
                self._recording.write(now_s, data)
            except InterfaceError as error:
                self._recording = None
                return [Finding("recording", f"ended: {error}")]
        return []


def _of_person(person: int, findings: list[Finding]) -> list[Finding]:
    return [Finding(f"person {person}, {subject}", message) for subject, message in findings]
