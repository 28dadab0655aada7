"""Receives a stream of MVN by UDP: decodes, checks, calibrates and records it."""

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

from .calibration import Calibration
from .checks import Finding, FrameChecks
from .packets import DEFAULT_PORT
from .recording import Recording
from .segments import SegmentFrame
from .stream import StreamDecoder

MOST_TOGETHER = 64
"""How many datagrams are read at most before what they say is given on."""
LARGEST_DATAGRAM = 65_535
BUFFER_BYTES = 1 << 20
REMARK_PERIOD_S = 1.0


class MvnConfig(ConfigModel):
    """Where MVN's stream comes from, and how it is to be read."""

    host: Text = Field("127.0.0.1", description="Address that listens; 0.0.0.0 takes what comes from other computers.")
    port: int = Field(DEFAULT_PORT, ge=0, le=65_535, description="UDP port; 0 is any that is free.")
    position_scale: Positive = Field(1.0, description="What positions are multiplied by to be in metres; not type 01.")
    y_up: Switch = Field(False, description="Whether MVN was told to send type 02 Y-up.")
    max_people: int = Field(8, ge=1, le=256, description="From how many people at most frames are taken.")
    timeout_s: Seconds = Field(0.5, description="After how long without a frame the stream counts as gone.")


class Silence(NamedTuple):
    """No frame of a person has come for some time [s]; told once."""

    person: int
    seconds: float


class Refused(NamedTuple):
    """A datagram was refused; the reason is one of `packets.REASONS`."""

    reason: str


class Receiver:
    """A socket, and what is made of the datagrams that it receives.

    One thread opens, polls and closes it; others may calibrate and record meanwhile.
    """

    def __init__(self, config: MvnConfig) -> None:
        self.config = config
        self.calibration = Calibration()
        self._decoder = StreamDecoder(config.position_scale, bool(config.y_up), config.max_people)
        self._checks: dict[int, FrameChecks] = {}
        self._newest: dict[int, tuple[float, SegmentFrame]] = {}
        """When the newest frame of each person came, and what it was before calibration; of those who are there."""
        self._socket: socket.socket | None = None
        self._remarks_due_s = 0.0
        self._lock = threading.Lock()
        self._recording: Recording | None = None

    @property
    def counts(self) -> Counter[str]:
        """What became of the datagrams, see `StreamDecoder`."""
        return self._decoder.counts

    @property
    def refusals(self) -> dict[str, str]:
        """What was the matter with the newest datagram that was refused, by reason."""
        return self._decoder.refusals

    @property
    def people(self) -> list[int]:
        """Whose frames come."""
        return sorted(self._newest.copy())

    @property
    def port(self) -> int:
        """The port that listens; 0 if none does."""
        return int(self._socket.getsockname()[1]) if self._socket else 0

    def open(self) -> None:
        """Listens from now on.

        Raises:
            OSError: If the address cannot be had.
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
        """Listens no more, forgets who was there, and ends a recording."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        with contextlib.suppress(InterfaceError):  # most often there is none
            self.stop_recording()
        self._forget()

    def poll(self, timeout_s: float) -> list[Any]:
        """Returns what has come: messages, `Finding`s, `Refused` and `Silence`; nothing after a time.

        Args:
            timeout_s: How long to wait for it [s].
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
        for _ in range(MOST_TOGETHER):
            try:
                data = self._socket.recv(LARGEST_DATAGRAM)
            except BlockingIOError:
                break
            now_s = time.monotonic()
            events += self._record(now_s, data)
            message = self._decoder.take(data)
            if isinstance(message, SegmentFrame):
                self._newest[message.person] = now_s, message
                checks = self._checks.setdefault(message.person, FrameChecks())
                events += _of_person(message.person, checks.take(message, now_s))
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

    # --- What other threads may call.

    def calibrate(self) -> str:
        """Takes the present pose of everybody as their T-pose; returns what was found, in words.

        Raises:
            InterfaceError: If nobody is there, or somebody stands otherwise; then nothing is changed for them.
        """
        newest = self._newest.copy()
        if not newest:
            raise InterfaceError("nobody is there: no frame has come lately")
        return "; ".join(self.calibration.fit(frame) for _, frame in newest.values())

    def start_recording(self, path: Path) -> None:
        """Records what comes from now on.

        Raises:
            InterfaceError: If a recording is running, or the file cannot be made.
        """
        with self._lock:
            if self._recording is not None:
                raise InterfaceError(f"{self._recording.path} is being recorded already")
            self._recording = Recording(path)

    def stop_recording(self) -> tuple[Path, int]:
        """Ends the recording; returns its path, and how many datagrams it has.

        Raises:
            InterfaceError: If none is running, or what is left cannot be written.
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
