"""Writes ROS bags record by record, so that each number in them may be wrong."""

from __future__ import annotations

import bz2
import struct
from dataclasses import dataclass, field
from pathlib import Path

import roslz4

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, FILE_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7


def uint32(value: int) -> bytes:
    return struct.pack("<I", value % 2**32)


def uint64(value: int) -> bytes:
    return struct.pack("<Q", value % 2**64)


def text(value: str | bytes) -> bytes:
    """Returns a string as messages have it."""
    data = value.encode() if isinstance(value, str) else value
    return uint32(len(data)) + data


def header(operation: int | None, **fields: bytes) -> bytes:
    """Returns a record's header with its length before it."""
    if operation is not None:
        fields = {"op": bytes([operation]), **fields}
    return text(b"".join(text(name.encode() + b"=" + value) for name, value in fields.items()))


@dataclass
class Topic:
    """A connection: a topic, the type of its messages, and further fields of its header."""

    name: str | bytes
    type: str
    definition: str | bytes
    md5sum: str = "0" * 32
    number: int | None = None
    more: dict[str, bytes] = field(default_factory=dict)

    def record(self, number: int) -> bytes:
        definition = self.definition.encode() if isinstance(self.definition, str) else self.definition
        name = self.name.encode() if isinstance(self.name, str) else self.name
        fields = {"topic": name, "type": self.type.encode(), "md5sum": self.md5sum.encode()}
        number = number if self.number is None else self.number
        head = header(CONNECTION, conn=uint32(number), topic=name)
        return head + header(None, **fields, message_definition=definition, **self.more)


@dataclass
class Bag:
    """Content of a bag; `chunks` are lists of a topic's number, a time [ns] and a serialised message.

    Attributes:
        topics: The connections.
        chunks: The messages of each chunk.
        compression: Of all chunks.
        claims: Numbers in the place of true ones: `size` of chunks, `count` of entries in index records, `chunks` and
            `connections` in the file's header, `index` as its position, `position` of chunks, `offset` of messages.
        repeats: How often each index entry, chunk info and connection record is repeated, by `entries`, `infos`,
            `connections`.
        head: More fields of the file's header.
    """

    topics: list[Topic]
    chunks: list[list[tuple[int, int, bytes]]]
    compression: str = "none"
    claims: dict[str, int] = field(default_factory=dict)
    repeats: dict[str, int] = field(default_factory=dict)
    head: dict[str, bytes] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Writes the file."""
        records = [each.record(number) for number, each in enumerate(self.topics)]
        head_size = len(MAGIC) + len(self._head(0, 0, 0)) + 4
        body, infos = bytearray(), []
        for messages in self.chunks:
            position = self.claims.get("position", head_size + len(body))
            data, entries = self._chunk(messages, records)
            body += data
            counts = b"".join(uint32(number) + uint32(len(each)) for number, each in entries.items())
            when = struct.pack("<II", 0, 0)
            fields = {"chunk_pos": uint64(position), "start_time": when, "end_time": when}
            info = header(CHUNK_INFO, ver=uint32(1), **fields, count=uint32(len(entries))) + text(counts)
            infos.append(info * self.repeats.get("infos", 1))
        index = b"".join(records) * self.repeats.get("connections", 1) + b"".join(infos)
        connections = self.claims.get("connections", len(records) * self.repeats.get("connections", 1))
        chunks = self.claims.get("chunks", len(infos) * self.repeats.get("infos", 1))
        start = self.claims.get("index", head_size + len(body))
        path.write_bytes(MAGIC + self._head(start, connections, chunks) + text(b"") + bytes(body) + index)

    def _head(self, index: int, connections: int, chunks: int) -> bytes:
        numbers = {"index_pos": uint64(index), "conn_count": uint32(connections), "chunk_count": uint32(chunks)}
        return header(FILE_HEADER, **numbers, **self.head)

    def _chunk(
        self, messages: list[tuple[int, int, bytes]], records: list[bytes]
    ) -> tuple[bytes, dict[int, list[bytes]]]:
        """Returns a chunk with its index records, and the entries of each connection in it."""
        data, entries = bytearray(), {}
        for topic, time_ns, raw in messages:
            number = self.topics[topic].number if self.topics[topic].number is not None else topic
            if number not in entries:
                data += records[topic]
            when = struct.pack("<II", *divmod(time_ns, 10**9))
            entry = when + uint32(self.claims.get("offset", len(data)))
            entries.setdefault(number, []).extend([entry] * self.repeats.get("entries", 1))
            data += header(MESSAGE, conn=uint32(number), time=when) + text(raw)
        packed = _packed(bytes(data), self.compression)
        size = uint32(self.claims.get("size", len(data)))
        chunk = bytearray(header(CHUNK, compression=self.compression.encode(), size=size) + text(packed))
        for number, each in entries.items():
            count = uint32(self.claims.get("count", len(each)))
            chunk += header(INDEX, ver=uint32(1), conn=uint32(number), count=count) + text(b"".join(each))
        return bytes(chunk), entries


def _packed(data: bytes, compression: str) -> bytes:
    if compression == "bz2":
        return bz2.compress(data)
    if compression == "lz4":
        return roslz4.compress(data)
    return data
