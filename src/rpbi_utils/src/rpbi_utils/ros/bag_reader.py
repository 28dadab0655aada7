"""Reads serialised messages out of a bag, and says in plain words why a file cannot be read."""

from __future__ import annotations

import bz2
from collections.abc import Collection, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import rosbag
import rosbag.bag

from custom_ros_tools.errors import shortened
from rpbi_utils.errors import BagError
from rpbi_utils.message_type import MessageType

_ACTIVE_SUFFIX = ".active"
_MAGIC = b"#ROSBAG V2.0\n"
MOST_UNFOLDED = 2**30
"""Bytes that any bag may unfold to."""
MOST_TIMES = 255
"""So many times its size a larger one may unfold to; LZ4, by which recorders compress, can do no more."""


class _NoClasses:
    """Stands in for rosbag's table of message classes while it reads: serialised messages need none.

    rosbag makes a class of every message definition in a bag, serialised or not, by writing Python and importing it; a
    definition may have any code in it.
    """

    @staticmethod
    def get(_: str) -> type:
        return _NoClasses


class _BoundedBz2:
    """Stands in for rosbag's bz2 while it reads: a chunk unfolds to what the largest one says, and no further."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes

    def decompress(self, data: bytes) -> bytes:
        unfolded = bz2.BZ2Decompressor().decompress(data, self._most_bytes + 1)
        if len(unfolded) > self._most_bytes:
            raise ValueError("a chunk unfolds to more than it says")
        return unfolded


def _guarded(most_bytes: int, read: Any, *arguments: Any) -> Any:
    """Returns what a function of rosbag returns, which makes no classes and unfolds no chunk to more than so much."""
    module = rosbag.bag
    before = module._message_types, module.bz2
    module._message_types, module.bz2 = _NoClasses, _BoundedBz2(most_bytes)
    try:
        return read(*arguments)
    finally:
        module._message_types, module.bz2 = before


def _require_reading_without_classes() -> None:
    """Raises a RuntimeError if this rosbag would make classes all the same."""
    connection = SimpleNamespace(md5sum="", datatype="std_msgs/Empty", msg_def="")
    if _guarded(0, rosbag.bag._get_message_type, connection) is not _NoClasses:
        raise RuntimeError("this rosbag is built otherwise: it would run code that a bag may have in its definitions")


class BagMessage(NamedTuple):
    """A serialised message of a bag, and when it was recorded [s], in ROS time."""

    topic: str
    type: MessageType
    raw: bytes
    record_time_s: float


class BagReader:
    """An open bag of any compression, as a context that closes it; needs no master and no message packages.

    Args:
        path: The file.
        any_size: Whether it may unfold to more than `MOST_UNFOLDED` and `MOST_TIMES` its size.

    Attributes:
        types: The message types of each topic, in the order of their names; nearly always one a topic.
        md5sums: Their md5 sums.
        counts: Number of messages of each topic.

    Raises:
        BagError: If there is no such file, it is no complete bag, or it unfolds to more than it may.
    """

    def __init__(self, path: str | Path, any_size: bool = False) -> None:
        self.path = Path(path)
        try:
            if not self.path.is_file():
                raise BagError(self.path, "there is no such file" if not self.path.exists() else "not a file")
            with self.path.open("rb") as file:
                begin = file.read(len(_MAGIC))
        except OSError as error:
            raise BagError(self.path, str(error.strerror or error).lower()) from error
        if begin != _MAGIC:  # rosbag imports whatever the much older formats name
            raise BagError(self.path, f"not a ROS 1 bag (expected one that begins with {_MAGIC.decode().strip()})")
        _require_reading_without_classes()
        self.types: dict[str, set[MessageType]] = {}
        self.md5sums: dict[str, set[str]] = {}
        self._types: dict[tuple[str, str], MessageType] = {}
        self._largest_chunk = 0
        self._bag = self._open()
        try:
            if not any_size:
                self._refuse_bombs()
            self._largest_chunk = max((each.uncompressed_size for each in self._bag._chunk_headers.values()), default=0)
            for each in sorted(self._bag._get_connections(), key=lambda connection: str(connection.topic)):
                key = each.datatype, each.md5sum
                if key not in self._types:
                    self._types[key] = MessageType.parse(each.datatype, each.msg_def)
                self.types.setdefault(each.topic, set()).add(self._types[key])
                self.md5sums.setdefault(each.topic, set()).add(each.md5sum)
            info = _guarded(0, self._bag.get_type_and_topic_info).topics
            self.counts: dict[str, int] = {topic: info[topic].message_count for topic in self.types}
        except BagError:
            self._bag.close()
            raise
        except Exception as error:  # as in `messages`
            self._bag.close()
            raise BagError(self.path, f"damaged: {_words(error)}") from error

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        self._bag.close()

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yields the messages of some topics in the order in which they were recorded.

        Raises:
            BagError: If the bag is damaged where a message should be.
        """
        if not topics:  # to rosbag, no topics means all
            return
        left = self._bag._uncompressed_size
        try:
            found = _guarded(0, lambda: self._bag.read_messages(topics=list(topics), raw=True))
            while (item := _guarded(self._largest_chunk, next, found, None)) is not None:
                topic, (datatype, raw, md5sum, *_), time = item
                left -= len(raw)
                if left < 0:
                    raise ValueError("its index names messages more than once")
                yield BagMessage(topic, self._types[datatype, md5sum], raw, time.to_sec())
        except Exception as error:  # rosbag lets out what struct, bz2, lz4 and its own checks raise
            message = f"damaged: {_words(error)}; what is left can be saved with 'rosbag reindex {self.path}'"
            raise BagError(self.path, message) from error

    def _open(self) -> rosbag.Bag:
        try:
            return _guarded(0, rosbag.Bag, str(self.path))
        except rosbag.ROSBagUnindexedException as error:
            raise BagError(self.path, self._why_unindexed()) from error
        except (rosbag.ROSBagException, UnicodeDecodeError) as error:
            raise BagError(self.path, f"not a ROS 1 bag ({error})") from error
        except OSError as error:
            raise BagError(self.path, str(error.strerror or error)) from error
        except Exception as error:  # as in `messages`
            raise BagError(self.path, f"damaged, or not a ROS 1 bag ({_words(error)})") from error

    def _refuse_bombs(self) -> None:
        """Raises a BagError if it unfolds to more than it may."""
        unfolded, size = self._bag._uncompressed_size, self.path.stat().st_size
        if unfolded > max(MOST_UNFOLDED, MOST_TIMES * size):
            message = f"its {size / 1e6:.3g} MB unfold to {unfolded / 1e9:.3g} GB: more than {MOST_TIMES} times as much"
            raise BagError(self.path, f"{message}; --any-size, if you know who made it")

    def _why_unindexed(self) -> str:
        repair = f"'rosbag reindex {self.path}'"
        if self.path.suffix == _ACTIVE_SUFFIX:
            return f"still being recorded, or its recorder died: stop the recorder, or repair it with {repair}"
        return f"has no index, as it was not closed properly or is cut off: repair it with {repair}"


def _words(error: Exception) -> str:
    """Returns what an error says in one short line."""
    return shortened(" ".join(str(error).split())) or type(error).__name__
