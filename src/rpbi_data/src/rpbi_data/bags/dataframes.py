"""Converts bags to pandas tables."""

import logging
import re
from collections.abc import Iterable
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from custom_ros_tools.errors import UnknownNameError, shortened

from .bag_reader import BagReader
from .errors import BagError
from .limits import LimitError
from .row_plan import INDEX, RECORD_TIME, STAMP
from .tables import TableBuilder

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
    """Reads a bag into pandas tables, one a topic.

    The index `time` is the stamp of the message's header in seconds of ROS time (float64, as `stamp.to_sec()`
    gives it), or the time of recording where a message has no header or its stamp is 0. Tables of one bag
    share this clock, so they can be joined by it. Rows are in the order of `time`; the column `record_time`
    [s] keeps when each was recorded. A warning names topics whose clock was set back by more than 1 s.

    The other columns are the fields, named by their path: `pose/position/x`, `data/0`, `header/frame_id`.
    Those of joint states are `position/JOINT`, `velocity/JOINT` and `effort/JOINT`, by name. A value that a
    message does not have is NaN, or None for text. Transforms (`/tf`) have a row each, with `parent` and
    `child`; diagnostics have a row a status, with `values/KEY`. `time` and `duration` fields are in seconds.

    Args:
        path: A `.bag` file, of any compression. No master and no message packages are needed.
        topics: Names of topics, or one name; by default all but those with binary data, such as images.
        images: Whether to include these by default. Their data are columns of `bytes`.
        any_size: Whether the bag may unfold to more than 1 GiB and 255 times its size, and take more time and memory
            than `rpbi_data.bags.limits` says.
        progress: Whether to show a progress bar.
        nanoseconds: Whether the index is an integer [ns], in which wall time is exact, too.

    Returns:
        Tables by topic, sorted by name.

    Raises:
        BagError: If there is no such file, it is no complete bag, it unfolds to more than it may, or a topic has more
            than `rpbi_data.bags.limits` says.
        UnknownNameError: If the bag does not have a topic that was named.
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
    """Reads a bag into one table with a row a message, as `rosbag_pandas` does.

    Args:
        path: A `.bag` file.
        include: Topics to read: a list of names, or a regular expression that the whole name matches; by default all
            without binary data.
        exclude: Topics to leave out, in the same form.
        any_size: See `bag_to_dataframes`.

    Returns:
        Columns `TOPIC/FIELD`, such as `/joint_states/position/0`, NaN or None in the rows of other topics. The index
        `time` is the time of recording in seconds, ascending. Stamps are in `TOPIC/header/stamp` [s].

    Raises:
        BagError: See `bag_to_dataframes`.
        UnknownNameError: If the bag does not have a topic that was named.
        ValueError: If a regular expression cannot be read.
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
    """Returns the topics that a regular expression or a list names."""
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
    """Returns a table by time of recording, with its topic in the names of its columns."""
    if any(each.has_header for each in bag.types[topic]):
        table.insert(1, STAMP, table.index)
    return table.set_index(RECORD_TIME).rename_axis(INDEX).add_prefix(f"{topic}/")


def _read(bag: BagReader, builders: dict[str, TableBuilder], progress: bool = False) -> dict[str, pd.DataFrame]:
    """Reads topics into their tables; empties `builders`."""
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
    """Returns the topics to read, sorted and each once."""
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
