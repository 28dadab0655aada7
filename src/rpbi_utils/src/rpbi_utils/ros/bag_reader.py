"""Reads serialised messages out of a bag, and says in plain words why a file cannot be read."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

import rosbag

from rpbi_utils.errors import BagError
from rpbi_utils.message_type import MessageType

_ACTIVE_SUFFIX = ".active"


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
        if not self.path.is_file():
            raise BagError(self.path, "there is no such file" if not self.path.exists() else "not a file")
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
            info = self._bag.get_type_and_topic_info().topics
        except ValueError as error:
            self._bag.close()
            raise BagError(self.path, str(error)) from error
        self.counts: dict[str, int] = {topic: info[topic].message_count for topic in self.types}

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
            for topic, (datatype, raw, md5sum, *_), time in self._bag.read_messages(topics=list(topics), raw=True):
                yield BagMessage(topic, self._types[datatype, md5sum], raw, time.to_sec())
        except Exception as error:  # rosbag lets out what struct, bz2, lz4 and its own checks raise
            message = f"damaged: {error}; what is left can be saved with 'rosbag reindex {self.path}'"
            raise BagError(self.path, message) from error

    def _open(self) -> rosbag.Bag:
        try:
            return rosbag.Bag(str(self.path))
        except rosbag.ROSBagUnindexedException as error:
            raise BagError(self.path, self._why_unindexed()) from error
        except (rosbag.ROSBagException, UnicodeDecodeError) as error:
            raise BagError(self.path, f"not a ROS 1 bag ({error})") from error
        except OSError as error:
            raise BagError(self.path, str(error.strerror or error)) from error

    def _why_unindexed(self) -> str:
        repair = f"'rosbag reindex {self.path}'"
        if self.path.suffix == _ACTIVE_SUFFIX:
            return f"still being recorded, or its recorder died: stop the recorder, or repair it with {repair}"
        return f"has no index, as it was not closed properly or is cut off: repair it with {repair}"
