"""Reads bags as serialised messages or as pandas tables."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from tqdm import tqdm

from custom_ros_tools.errors import UnknownNameError, shortened

from .bag_file import BagFile, NotABagError
from .limits import MAX_ALL_DEFINITIONS_BYTES, MAX_TOPICS, BagError, Budget, LimitError
from .message_layout import MessageType
from .row_plan import INDEX, RECORD_TIME, STAMP
from .tables import TableBuilder
from .times import ClockStep, to_seconds

_ACTIVE_SUFFIX = ".active"
MAX_UNPACKED_BYTES = 2**30
"""Unpacked size above which the compression ratio of a bag is limited by `MAX_COMPRESSION` [bytes]."""
MAX_COMPRESSION = 255
"""Largest compression ratio of bags above `MAX_UNPACKED_BYTES`; LZ4, which recorders use, cannot exceed it."""


class BagMessage(NamedTuple):
    """A serialised message of a bag, and the ROS time at which the message was recorded [ns]."""

    topic: str
    type: MessageType
    raw: bytes
    record_time_ns: int

    @property
    def record_time_s(self) -> float:
        """ROS time at which the message was recorded [s]."""
        return float(to_seconds(self.record_time_ns))


class BagReader:
    """Reads a bag with any compression, without a ROS master or message packages.

    Used as a context manager, which closes the bag.

    Args:
        path: The bag.
        any_size: Whether the bag may exceed `MAX_UNPACKED_BYTES` and `MAX_COMPRESSION`, and the limits of `Budget`.

    Attributes:
        types: Set of message types, indexed by topic and sorted by topic; nearly always one type per topic.
        md5sums: MD5 sums of the message types, indexed by topic.
        counts: Number of messages, indexed by topic.
        budget: Limits of the processor time and of the number of table cells.

    Raises:
        BagError: If the file does not exist, is not a complete bag, or exceeds a limit.
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
        """Yields the messages of given topics in the order of recording.

        Raises:
            BagError: If the bag is damaged, or the processor time is used up. The time that the caller's thread spends
                between messages counts, too.
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
        """Returns the largest backward step between a topic's recording times, read in the order of the file."""
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
        """Raises a BagError if the unpacked size of the bag exceeds the limit."""
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
    """Returns the message of an error, shortened to one line."""
    return shortened(" ".join(str(error).split())) or type(error).__name__


_log = logging.getLogger(__name__)


def bag_to_dataframes(
    path: str | Path,
    topics: str | Iterable[str] | None = None,
    *,
    images: bool = False,
    any_size: bool = False,
    progress: bool = False,
    nanoseconds: bool = False,
) -> dict[str, pd.DataFrame]:
    """Reads a bag into pandas tables, one per topic.

    The index `time` is the stamp of the message's header in ROS time [s], float64 as from `stamp.to_sec()`. If a
    message has no header, or its stamp is 0, `time` is the recording time. All tables of a bag share this clock, so
    they can be joined on `time`. Rows are sorted by `time`; the column `record_time` is the recording time [s]. A
    warning names topics whose clock was set back by more than 1 s.

    The other columns are the fields of the message, named by path: `pose/position/x`, `data/0`, `header/frame_id`.
    Columns of joint states contain the joint name: `position/JOINT`, `velocity/JOINT`, `effort/JOINT`. A value that
    a message lacks is NaN, or None for text. Each transform of `/tf` is a row with the columns `parent` and `child`.
    Each status of diagnostics is a row with columns `values/KEY`. `time` and `duration` fields are in seconds.

    Args:
        path: A `.bag` file with any compression. A ROS master and message packages are not needed.
        topics: Topics to read: names, or one name. By default all topics except those with binary data, like images.
        images: Whether the default includes topics with binary data, which become columns of `bytes`.
        any_size: Whether the bag may unpack to more than both 1 GiB and 255 times its file size, and may exceed the
            limits of time and cells in `rpbi_data.bags.limits`.
        progress: Whether to show a progress bar.
        nanoseconds: Whether the index is int64 [ns] instead of float64 [s]. Only int64 represents wall time exactly.

    Returns:
        Tables, indexed by topic and sorted by topic.

    Raises:
        BagError: If the file does not exist, is not a complete bag, unpacks to too many bytes, or exceeds a limit in
            `rpbi_data.bags.limits`.
        UnknownNameError: If the bag lacks one of the given topics.
    """
    with BagReader(path, any_size) as bag:
        chosen = _choose(bag, [topics] if isinstance(topics, str) else topics, images)
        keep_binary = images or topics is not None
        builders = {topic: TableBuilder(topic, keep_binary, bag.budget, in_nanoseconds=nanoseconds) for topic in chosen}
        return _read(bag, builders, progress)


def bag_to_dataframe(
    path: str | Path,
    include: str | Iterable[str] | None = None,
    exclude: str | Iterable[str] | None = None,
    *,
    any_size: bool = False,
) -> pd.DataFrame:
    """Reads a bag into one table with a row for each message, like the package `rosbag_pandas`.

    Args:
        path: A `.bag` file.
        include: Topics to read: a list of names, or a regular expression for the whole name. By default all topics
            without binary data.
        exclude: Topics to leave out, in the same form.
        any_size: See `bag_to_dataframes`.

    Returns:
        A table with columns `TOPIC/FIELD`, such as `/joint_states/position/0`, which are NaN or None in rows of
        other topics. The index `time` is the recording time [s], ascending. Stamps are in `TOPIC/header/stamp` [s].

    Raises:
        BagError: See `bag_to_dataframes`.
        UnknownNameError: If the bag lacks one of the listed topics.
        ValueError: If a regular expression is invalid.
    """
    with BagReader(path, any_size) as bag:
        topics = _choose(bag, _named(bag, include), images=False)
        left_out = set(_named(bag, exclude) or ())
        chosen = [topic for topic in topics if topic not in left_out]
        builders = {topic: TableBuilder(topic, include is not None, bag.budget, is_plain=True) for topic in chosen}
        tables = _read(bag, builders)
        rows = [_by_record_time(table, bag, topic) for topic, table in tables.items()]
    return pd.concat([pd.DataFrame(index=pd.Index([], dtype=float, name=INDEX)), *rows]).sort_index(kind="stable")


def _named(bag: BagReader, topics: str | Iterable[str] | None) -> list[str] | None:
    """Returns the topics that match a regular expression, or the listed topics; None if `topics` is None."""
    if topics is None:
        return None
    if not isinstance(topics, str):
        return list(topics)
    try:
        pattern = re.compile(topics)
    except re.error as error:
        raise ValueError(f"expected a regular expression, got '{topics}': {error}") from error
    return [topic for topic in bag.types if pattern.fullmatch(topic)]


def _by_record_time(table: pd.DataFrame, bag: BagReader, topic: str) -> pd.DataFrame:
    """Returns a table indexed by recording time, whose column names begin with the topic."""
    if any(each.has_header for each in bag.types[topic]):
        table.insert(1, STAMP, table.index)
    return table.set_index(RECORD_TIME).rename_axis(INDEX).add_prefix(f"{topic}/")


def _read(bag: BagReader, builders: dict[str, TableBuilder], progress: bool = False) -> dict[str, pd.DataFrame]:
    """Reads the topics of `builders` into tables; removes each builder when its table is complete."""
    chosen = list(builders)
    total = sum(bag.counts[topic] for topic in chosen)
    bar = tqdm(bag.messages(chosen), total=total, unit=" messages", unit_scale=True, leave=False, disable=not progress)
    topic = ""
    try:
        for topic, message_type, raw, record_time_ns in bar:
            builders[topic].add(message_type, raw, record_time_ns)
        tables = {}
        for topic in chosen:
            tables[topic] = builders.pop(topic).table()
            if (clock := bag.clock_of(topic)).is_fault:
                _log.warning("%s: %s", topic, clock)
    except LimitError as error:
        raise BagError(bag.path, f"{shortened(topic)}: {error}; other topics can be read by their names") from error
    return tables


def _choose(bag: BagReader, topics: Iterable[str] | None, images: bool) -> list[str]:
    """Returns the topics to read, sorted and without duplicates."""
    if topics is not None:
        chosen = sorted(set(topics))
        for topic in chosen:
            if topic not in bag.types:
                raise UnknownNameError("topic", topic, bag.types)
        return chosen
    if images:
        return list(bag.types)
    binary = [topic for topic, types in bag.types.items() if any(each.holds_bytes for each in types)]
    if binary:
        _log.info("left out, as they hold binary data: %s", ", ".join(binary))
    return [topic for topic in bag.types if topic not in binary]
