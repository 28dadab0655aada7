"""Writes and reads recordings of a stream: the unchanged datagrams, with their times of arrival.

A file begins with the line `MVN datagrams 1`. Each record consists of three parts: the time since the first datagram's
arrival [s] as a big-endian double, the datagram's length as a big-endian unsigned short, and the datagram.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError

MAGIC = b"MVN datagrams 1\n"
MAX_PAUSE_S = 3600.0
_RECORD = struct.Struct(">dH")


class Record(NamedTuple):
    """A datagram, and the time from the first datagram's arrival to this datagram's arrival [s]."""

    time_s: float
    data: bytes


class DatagramRecording:
    """Writes datagrams to a new file.

    Raises:
        InterfaceError: If the file exists already, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.count = path, 0
        self._begin_s: float | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(path, "xb")
            self._file.write(MAGIC)
        except OSError as error:
            raise _cannot_write(path, error) from None

    def write(self, now_s: float, data: bytes) -> None:
        """Appends a datagram that arrived at the time `now_s` of any steady clock [s].

        Raises:
            InterfaceError: If the file cannot be written, for instance because the disk is full.
        """
        if self._begin_s is None:
            self._begin_s = now_s
        try:
            self._file.write(_RECORD.pack(max(now_s - self._begin_s, 0.0), len(data)) + data)
        except OSError as error:
            raise _cannot_write(self.path, error) from None
        self.count += 1

    def close(self) -> None:
        """Closes the file.

        Raises:
            InterfaceError: If the remaining data cannot be written.
        """
        try:
            self._file.close()
        except OSError as error:
            raise _cannot_write(self.path, error) from None


def _cannot_write(path: Path, error: OSError) -> InterfaceError:
    return InterfaceError(f"{path}: cannot be written: {error.strerror}")


def read_recording(path: Path) -> Iterator[Record]:
    """Yields the records of a file. An incomplete record at the end of the file is dropped.

    Raises:
        InterfaceError: If the file cannot be read, is not a recording, or has invalid times.
    """
    try:
        with open(path, "rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise InterfaceError(f"{path}: is no recording: expected the line '{MAGIC.decode().strip()}' first")
            before_s = 0.0
            while len(head := file.read(_RECORD.size)) == _RECORD.size:
                at = file.tell()
                time_s, length = _RECORD.unpack(head)
                if not before_s <= time_s <= before_s + MAX_PAUSE_S:
                    raise InterfaceError(f"{path}: byte {at}: expected a time after {before_s:g} s, got {time_s:g} s")
                data = file.read(length)
                if len(data) < length:
                    return
                before_s = time_s
                yield Record(time_s, data)
    except OSError as error:
        raise InterfaceError(f"{path}: cannot be read: {error.strerror}") from None
