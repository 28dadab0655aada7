"""Reads the records of a ROS bag of format 2.0, without ROS and without executing definitions.

`rosbag` generates a Python class for every message definition in a bag, which executes code hidden in a definition.
`rosbag` also needs quadratic time for long headers, and reads a message as often as the index lists the message. This
module reads each record once, in time and memory proportional to the file.
"""

import bz2
import struct
from collections.abc import Collection, Iterator
from typing import BinaryIO, NamedTuple

import lz4.frame
import numpy as np

from .limits import MAX_CONNECTIONS, LimitError
from .times import PER_SECOND, ClockStep, set_back

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _FILE_HEADER, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_UINT32, _UINT64, _TIME = struct.Struct("<I"), struct.Struct("<Q"), struct.Struct("<II")
_ENTRY = np.dtype([("secs", "<u4"), ("nsecs", "<u4"), ("offset", "<u4")])
_SORTED = np.dtype([("time_ns", "u8"), ("chunk", "u4"), ("offset", "u4")])
_MAX_RECORD_HEADER = 2**16
_MAX_CONNECTION_HEADER = 2**21
_PIECE = 2**16
_BLOCK = 2**16
_PLAIN_ENCRYPTION = (b"", b"rosbag/NoEncryptor")

Fields = dict[bytes, bytes]


class Connection(NamedTuple):
    """One publisher of a topic, with type, MD5 sum and definition of the messages."""

    topic: str
    datatype: str
    md5sum: str
    definition: str


class Chunk(NamedTuple):
    """A block of messages that are compressed together in the file.

    Attributes:
        compression: `none`, `bz2` or `lz4`.
        size: Uncompressed size according to the chunk's header [bytes].
        start: Offset of the chunk's data in the file [bytes].
        compressed_size: Size of the chunk's data in the file [bytes].
    """

    compression: str
    size: int
    start: int
    compressed_size: int


class BagFile:
    """An open bag.

    Args:
        file: The bag, opened in binary mode.

    Attributes:
        connections: Connections, indexed by connection number.
        chunks: The chunks, in the order of the index.
        counts: Number of messages of each connection, indexed by the connection's number.

    Raises:
        NotABagError: If the file does not begin like a bag, or is encrypted.
        LimitError: If the bag has too many connections.
        ValueError, struct.error, KeyError: If the bag's index is missing or broken.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = file.seek(0, 2)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            raise NotABagError(f"expected one that begins with {MAGIC.decode().strip()}")
        header = self._record_header(_FILE_HEADER)
        if header.get(b"encryptor", b"") not in _PLAIN_ENCRYPTION:
            raise NotABagError("it is encrypted; decrypt it first, with 'rosbag decrypt'")
        connection_count, chunk_count = _uint32(header, b"conn_count"), _uint32(header, b"chunk_count")
        if connection_count > MAX_CONNECTIONS:
            raise LimitError.over(f"{MAX_CONNECTIONS:,} connections", f"{connection_count:,}")
        index_start = _UINT64.unpack(header[b"index_pos"])[0]
        if not 0 < index_start <= self._size:
            raise ValueError("it has no index")
        file.seek(index_start)
        self.connections = dict(self._connection() for _ in range(connection_count))
        infos = dict(self._chunk_info() for _ in range(chunk_count))
        if len(infos) < chunk_count:
            raise ValueError("its index names a chunk more than once")
        self.chunks = [self._chunk(position) for position in infos]
        self._index: dict[int, list[np.ndarray]] = {number: [] for number in self.connections}
        entries_left = self._size // _ENTRY.itemsize
        for number, kinds in enumerate(infos.values()):
            file.seek(self.chunks[number].start + self.chunks[number].compressed_size)
            for _ in range(kinds):
                entries_left -= self._index_record(number)
                if entries_left < 0:
                    raise ValueError("its index names messages more than once")
        self.counts = {number: sum(map(len, pieces)) for number, pieces in self._index.items()}

    @property
    def unfolded_bytes(self) -> int:
        """Uncompressed size of all chunks, according to their headers [bytes]."""
        return sum(each.size for each in self.chunks)

    def clock_of(self, connections: Collection[int]) -> ClockStep:
        """Returns the largest backward step between recording times of given connections, in the order of the file."""
        index = self._index_of(connections)
        index = index[np.lexsort((index["offset"], index["chunk"]))]
        return set_back(index["time_ns"] / 1e9)

    def messages(self, connections: Collection[int]) -> Iterator[tuple[int, bytes, int]]:
        """Yields the messages of given connections in the order of recording time.

        Each item is the connection's number, the serialised message, and the recording time [ns].

        Raises:
            ValueError, struct.error, KeyError, OSError, EOFError: If the bag is damaged.
        """
        index = self._index_of(connections)
        index = index[np.argsort(index["time_ns"], kind="stable")]
        unfolded, data = -1, b""
        for start in range(0, len(index), _BLOCK):
            for _, chunk, offset in index[start : start + _BLOCK].tolist():
                if chunk != unfolded:
                    unfolded, data = chunk, self._unfold(self.chunks[chunk])
                yield _message(data, offset)

    def _index_of(self, connections: Collection[int]) -> np.ndarray:
        pieces = [piece for number in self.connections if number in connections for piece in self._index[number]]
        return np.concatenate([*pieces, np.empty(0, _SORTED)])

    def _read(self, size: int) -> bytes:
        data = self._file.read(size) if size <= self._size else b""
        if len(data) < size:
            raise ValueError(f"expected {size} bytes, got {len(data)}")
        return data

    def _sized(self, most: int) -> bytes:
        """Reads a size, and then a block of bytes of this size; raises a ValueError if the size exceeds `most`."""
        (size,) = _UINT32.unpack(self._read(4))
        if size > most:
            raise ValueError(f"expected a header of at most {most} bytes, got {size}")
        return self._read(size)

    def _record_header(self, operation: int) -> Fields:
        fields = _fields(self._sized(_MAX_RECORD_HEADER))
        if fields[b"op"] != bytes([operation]):
            raise ValueError(f"expected a record of kind {operation}, got {fields[b'op']!r:.60}")
        return fields

    def _connection(self) -> tuple[int, Connection]:
        header = self._record_header(_CONNECTION)
        fields = _fields(self._sized(_MAX_CONNECTION_HEADER))
        texts = [fields[key].decode() for key in (b"type", b"md5sum", b"message_definition")]
        return _uint32(header, b"conn"), Connection(header[b"topic"].decode(), *texts)

    def _chunk_info(self) -> tuple[int, int]:
        """Reads a record about a chunk; returns the offset of the chunk and the number of connections in the chunk."""
        header = self._record_header(_CHUNK_INFO)
        (size,) = _UINT32.unpack(self._read(4))
        count = _uint32(header, b"count")
        if size != 8 * count:
            raise ValueError(f"expected {8 * count} bytes, got {size}")
        self._read(size)
        (position,) = _UINT64.unpack(header[b"chunk_pos"])
        return position, count

    def _chunk(self, position: int) -> Chunk:
        self._file.seek(min(position, self._size))
        header = self._record_header(_CHUNK)
        (compressed_size,) = _UINT32.unpack(self._read(4))
        start = self._file.tell()
        if start + compressed_size > self._size:
            raise ValueError("a chunk ends after the end of the file")
        compression = header[b"compression"].decode()
        size = compressed_size if compression == "none" else _uint32(header, b"size")
        return Chunk(compression, size, start, compressed_size)

    def _index_record(self, chunk: int) -> int:
        """Reads the index of one connection's messages in a chunk, and returns the number of these messages."""
        header = self._record_header(_INDEX)
        count = _uint32(header, b"count")
        (size,) = _UINT32.unpack(self._read(4))
        if size != _ENTRY.itemsize * count:
            raise ValueError(f"expected {_ENTRY.itemsize * count} bytes, got {size}")
        entries = np.frombuffer(self._read(size), _ENTRY)
        found = np.empty(count, _SORTED)
        found["time_ns"] = entries["secs"].astype("u8") * PER_SECOND + entries["nsecs"]
        found["chunk"], found["offset"] = chunk, entries["offset"]
        self._index[_uint32(header, b"conn")].append(found)
        return count

    def _unfold(self, chunk: Chunk) -> bytes:
        """Returns the uncompressed data of a chunk; raises a ValueError if the data are larger than `chunk.size`."""
        self._file.seek(chunk.start)
        data = self._read(chunk.compressed_size)
        if chunk.compression == "none":
            return data
        if chunk.compression == "bz2":
            unfolded = bz2.BZ2Decompressor().decompress(data, chunk.size + 1)
        elif chunk.compression == "lz4":
            unfolded = _unfold_lz4(data, chunk.size)
        else:
            raise ValueError(f"expected compression none, bz2 or lz4, got '{chunk.compression:.60}'")
        if len(unfolded) > chunk.size:
            raise ValueError("a chunk unfolds to more than its stated size")
        return unfolded


class NotABagError(ValueError):
    """A file is not a bag of format 2.0, or is encrypted."""


def _unfold_lz4(data: bytes, size: int) -> bytes:
    unfolder, pieces, left = lz4.frame.LZ4FrameDecompressor(), [], size
    for start in range(0, len(data), _PIECE):
        try:
            pieces.append(unfolder.decompress(data[start : start + _PIECE]))
        except RuntimeError as error:
            raise ValueError(f"LZ4: {error}") from None
        left -= len(pieces[-1])
        if left < 0 or unfolder.eof:
            break
    return b"".join(pieces)


def _fields(header: bytes) -> Fields:
    """Returns the values of a record header, indexed by field name."""
    fields, at = {}, 0
    while at < len(header):
        (size,) = _UINT32.unpack_from(header, at)
        name, equal, value = header[at + 4 : at + 4 + size].partition(b"=")
        at += 4 + size
        if not equal or at > len(header):
            raise ValueError("a header is broken")
        fields[name] = value
    return fields


def _uint32(fields: Fields, name: bytes) -> int:
    value: int = _UINT32.unpack(fields[name])[0]
    return value


def _message(data: bytes, offset: int) -> tuple[int, bytes, int]:
    """Reads the message at an offset in a chunk. If connection records precede the message, skips them.

    Returns:
        The connection's number, the serialised message, and the recording time [ns].
    """
    while True:
        (size,) = _UINT32.unpack_from(data, offset)
        fields = _fields(data[offset + 4 : offset + 4 + size])
        offset += 4 + size
        (size,) = _UINT32.unpack_from(data, offset)
        start, offset = offset + 4, offset + 4 + size
        if offset > len(data):
            raise ValueError("a message ends after the end of its chunk")
        if fields[b"op"][0] != _CONNECTION:
            break
    if fields[b"op"][0] != _MESSAGE:
        raise ValueError(f"expected a message, got a record of kind {fields[b'op'][0]}")
    secs, nsecs = _TIME.unpack(fields[b"time"])
    return _uint32(fields, b"conn"), data[start:offset], secs * PER_SECOND + nsecs
