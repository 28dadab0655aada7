"""Reads serialised messages from a bag, and reports in plain words why a file cannot be read."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.errors import shortened

from .bag_file import BagFile, NotABagError
from .clock import ClockStep
from .errors import BagError
from .limits import MAX_ALL_DEFINITIONS_BYTES, MAX_TOPICS, Budget, LimitError
from .message_type import MessageType
from .nanoseconds import to_seconds

_ACTIVE_SUFFIX = ".active"
MAX_UNPACKED_BYTES = 2**30
"""Size to which any bag may be unpacked [bytes]; larger ones are limited by `MAX_COMPRESSION`."""
MAX_COMPRESSION = 255
"""Largest compression ratio of bags above `MAX_UNPACKED_BYTES`; LZ4, used by recorders, reaches no more."""


class BagMessage(NamedTuple):
    """A serialised message of a bag, and its recording time [ns], in ROS time."""

    topic: str
    type: MessageType
    raw: bytes
    record_time_ns: int

    @property
    def record_time_s(self) -> float:
        """Time at which it was recorded [s]."""
        return float(to_seconds(self.record_time_ns))


class BagReader:
    """An open bag of any compression, as a context that closes it; needs no master and no message packages.

    Args:
        path: The file.
        any_size: Whether it may exceed `MAX_UNPACKED_BYTES` and `MAX_COMPRESSION`, and the limits on time and cells.

    Attributes:
        types: The message types of each topic, in the order of their names; nearly always one a topic.
        md5sums: Their md5 sums.
        counts: Number of messages of each topic.
        budget: Limits of time and cells of tables.

    Raises:
        BagError: If there is no such file, it is no complete bag, or it is larger than it may be.
    """

    def __init__(self, path: str | Path, any_size: bool = False) -> None:
        self.path = Path(path)
        try:
            if not self.path.is_file():
                raise BagError(self.path, "there is no such file" if not self.path.exists() else "not a file")
            self._file = self.path.open("rb")
        except OSError as error:
            raise BagError(self.path, str(error.strerror or error)) from error
        try:
            self._bag = self._open()
            if not any_size:
                self._refuse_bombs()
            self.budget = Budget(self.path, self.path.stat().st_size, any_size)
            self._read_connections()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yields the messages of some topics in the order in which they were recorded.

        Raises:
            BagError: If the bag is damaged at a message, or needs too much time; the time of the caller between
                messages counts.
        """
        chosen = {number: each for number, each in self._types.items() if each[0] in topics}
        left = self._bag.unfolded_bytes
        found = self._bag.messages(chosen)
        while True:
            try:
                number, raw, record_time_ns = next(found)
                topic, message_type = chosen[number]
                left -= len(raw)
                if left < 0:
                    raise ValueError("its index names messages more than once")
            except StopIteration:
                return
            except Exception as error:  # struct, bz2 and lz4 have errors of their own
                message = f"damaged: {_words(error)}; what is left can be saved with 'rosbag reindex {self.path}'"
                raise BagError(self.path, message) from error
            self.budget.check_time(topic)
            yield BagMessage(topic, message_type, raw, record_time_ns)

    def clock_of(self, topic: str) -> ClockStep:
        """Returns the largest step back in the recording times of a topic, in the order of the file."""
        return self._bag.clock_of([number for number, each in self._types.items() if each[0] == topic])

    def _open(self) -> BagFile:
        try:
            return BagFile(self._file)
        except NotABagError as error:
            raise BagError(self.path, f"not a ROS 1 bag ({error})") from error
        except LimitError as error:
            raise BagError(self.path, str(error)) from error
        except OSError as error:
            raise BagError(self.path, str(error.strerror or error)) from error
        except Exception as error:  # as in `messages`
            raise BagError(self.path, self._why_unindexed()) from error

    def _read_connections(self) -> None:
        """Reads the types of all topics that have messages."""
        self.types: dict[str, set[MessageType]] = {}
        self.md5sums: dict[str, set[str]] = {}
        self.counts: dict[str, int] = {}
        self._types: dict[int, tuple[str, MessageType]] = {}
        known: dict[tuple[str, str], MessageType] = {}
        topics = len({each.topic for number, each in self._bag.connections.items() if self._bag.counts[number]})
        if topics > MAX_TOPICS:
            raise BagError(self.path, str(LimitError.over(f"{MAX_TOPICS:,} topics", f"{topics:,}")))
        left = MAX_ALL_DEFINITIONS_BYTES
        for number, each in sorted(self._bag.connections.items(), key=lambda item: item[1].topic):
            if not self._bag.counts[number]:
                continue
            topic, key = each.topic, (each.datatype, each.definition)
            try:
                if key not in known:
                    left -= len(each.definition)
                    if left < 0:
                        raise LimitError.over(f"{MAX_ALL_DEFINITIONS_BYTES:,} bytes of definitions in a bag", "more")
                    known[key] = MessageType.parse(*key)
            except ValueError as error:
                what = str(error) if isinstance(error, LimitError) else f"damaged: {_words(error)}"
                raise BagError(self.path, f"{shortened(topic)}: {what}") from error
            self._types[number] = topic, known[key]
            self.types.setdefault(topic, set()).add(known[key])
            self.md5sums.setdefault(topic, set()).add(each.md5sum)
            self.counts[topic] = self.counts.get(topic, 0) + self._bag.counts[number]

    def _refuse_bombs(self) -> None:
        """Raises a BagError if its unpacked size is above the limit."""
        unfolded, size = self._bag.unfolded_bytes, self.path.stat().st_size
        if unfolded > max(MAX_UNPACKED_BYTES, MAX_COMPRESSION * size):
            message = (
                f"its {size / 1e6:.3g} MB unfold to {unfolded / 1e9:.3g} GB: more than {MAX_COMPRESSION} times as much"
            )
            raise BagError(self.path, f"{message}; --any-size, if you know who made it")

    def _why_unindexed(self) -> str:
        repair = f"'rosbag reindex {self.path}'"
        if self.path.suffix == _ACTIVE_SUFFIX:
            return f"still being recorded, or its recorder died: stop the recorder, or repair it with {repair}"
        return f"has no index, as it was not closed properly or is cut off: repair it with {repair}"


def _words(error: Exception) -> str:
    """Returns the text of an error in one short line."""
    return shortened(" ".join(str(error).split())) or type(error).__name__
