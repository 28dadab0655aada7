"""Reads serialised messages out of a bag, and says in plain words why a file cannot be read."""

from __future__ import annotations

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


class _NoClasses:
    """Stands in for rosbag's table of message classes while it reads: serialised messages need none.

    rosbag makes a class of every message definition in a bag, serialised or not, by writing Python and importing it; a
    definition may have any code in it.
    """

    @staticmethod
    def get(_: str) -> type:
        return _NoClasses


def _without_classes(read: Any, *arguments: Any) -> Any:
    """Returns what a function of rosbag returns that is not to make classes."""
    table, rosbag.bag._message_types = rosbag.bag._message_types, _NoClasses
    try:
        return read(*arguments)
    finally:
        rosbag.bag._message_types = table


def _require_reading_without_classes() -> None:
    """Raises a RuntimeError if this rosbag would make classes all the same."""
    connection = SimpleNamespace(md5sum="", datatype="std_msgs/Empty", msg_def="")
    if _without_classes(rosbag.bag._get_message_type, connection) is not _NoClasses:
        raise RuntimeError("this rosbag is built otherwise: it would run code that a bag may have in its definitions")


class BagMessage(NamedTuple):
    """A serialised message of a bag, and when it was recorded [s], in ROS time."""

    topic: str
    type: MessageType
    raw: bytes
    record_time_s: float


class BagReader:
    """An open bag of any compression, as a context that closes it; needs no master and no message packages.

    Attributes:
        types: The message types of each topic, in the order of their names; nearly always one a topic.
        md5sums: Their md5 sums.
        counts: Number of messages of each topic.

    Raises:
        BagError: If there is no such file, or it is no complete bag.
    """

    def __init__(self, path: str | Path) -> None:
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
        self._bag = self._open()
        try:
            for each in sorted(self._bag._get_connections(), key=lambda connection: str(connection.topic)):
                key = each.datatype, each.md5sum
                if key not in self._types:
                    self._types[key] = MessageType.parse(each.datatype, each.msg_def)
                self.types.setdefault(each.topic, set()).add(self._types[key])
                self.md5sums.setdefault(each.topic, set()).add(each.md5sum)
            info = _without_classes(self._bag.get_type_and_topic_info).topics
            self.counts: dict[str, int] = {topic: info[topic].message_count for topic in self.types}
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
        try:
            found = _without_classes(lambda: self._bag.read_messages(topics=list(topics), raw=True))
            while (item := _without_classes(next, found, None)) is not None:
                topic, (datatype, raw, md5sum, *_), time = item
                yield BagMessage(topic, self._types[datatype, md5sum], raw, time.to_sec())
        except Exception as error:  # rosbag lets out what struct, bz2, lz4 and its own checks raise
            message = f"damaged: {_words(error)}; what is left can be saved with 'rosbag reindex {self.path}'"
            raise BagError(self.path, message) from error

    def _open(self) -> rosbag.Bag:
        try:
            return _without_classes(rosbag.Bag, str(self.path))
        except rosbag.ROSBagUnindexedException as error:
            raise BagError(self.path, self._why_unindexed()) from error
        except (rosbag.ROSBagException, UnicodeDecodeError) as error:
            raise BagError(self.path, f"not a ROS 1 bag ({error})") from error
        except OSError as error:
            raise BagError(self.path, str(error.strerror or error)) from error
        except Exception as error:  # as in `messages`
            raise BagError(self.path, f"damaged, or not a ROS 1 bag ({_words(error)})") from error

    def _why_unindexed(self) -> str:
        repair = f"'rosbag reindex {self.path}'"
        if self.path.suffix == _ACTIVE_SUFFIX:
            return f"still being recorded, or its recorder died: stop the recorder, or repair it with {repair}"
        return f"has no index, as it was not closed properly or is cut off: repair it with {repair}"


def _words(error: Exception) -> str:
    """Returns what an error says in one short line."""
    return shortened(" ".join(str(error).split())) or type(error).__name__
