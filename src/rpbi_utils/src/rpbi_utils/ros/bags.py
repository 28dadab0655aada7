"""Bags to pandas tables."""

import logging
from collections.abc import Iterable
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from custom_ros_tools.errors import UnknownNameError, shortened
from rpbi_utils.errors import BagError
from rpbi_utils.limits import LimitError
from rpbi_utils.tables import TableBuilder

from .bag_reader import BagReader

_log = logging.getLogger(__name__)


def bag_to_dataframes(
    path: str | Path,
    topics: str | Iterable[str] | None = None,
    *,
    images: bool = False,
    any_size: bool = False,
    progress: bool = False,
) -> dict[str, pd.DataFrame]:
    """Reads a bag into pandas tables, one a topic.

    The index `time` is the stamp of the message's header in seconds of ROS time (float64, as `stamp.to_sec()`
    gives it), or the time of recording where a message has no header or its stamp is 0. Tables of one bag
    share this clock, so they can be joined by it. Rows are in the order of `time`; the column `record_time`
    [s] keeps when each was recorded.

    The other columns are the fields, named by their path: `pose/position/x`, `data/0`, `header/frame_id`.
    Those of joint states are `position/JOINT`, `velocity/JOINT` and `effort/JOINT`, by name. A value that a
    message does not have is NaN, or None for text. Transforms (`/tf`) have a row each, with `parent` and
    `child`; diagnostics have a row a status, with `values/KEY`. `time` and `duration` fields are in seconds.

    Args:
        path: A `.bag` file, of any compression. No master and no message packages are needed.
        topics: Names of topics, or one name; by default all but those with binary data, such as images.
        images: Whether to include these by default. Their data are columns of `bytes`.
        any_size: Whether the bag may unfold to more than 1 GiB and 255 times its size, and take more time and memory
            than `rpbi_utils.limits` says.
        progress: Whether to show a progress bar.

    Returns:
        Tables by topic, sorted by name.

    Raises:
        BagError: If there is no such file, it is no complete bag, it unfolds to more than it may, or a topic has more
            than `rpbi_utils.limits` says.
        UnknownNameError: If the bag does not have a topic that was named.
    """
    with BagReader(path, any_size) as bag:
        chosen = _choose(bag, [topics] if isinstance(topics, str) else topics, images)
        builders = {topic: TableBuilder(topic, images or topics is not None, bag.budget) for topic in chosen}
        total = sum(bag.counts[topic] for topic in chosen)
        messages = bag.messages(chosen)
        bar = tqdm(messages, total=total, unit=" messages", unit_scale=True, leave=False, disable=not progress)
        topic = ""
        try:
            for topic, message_type, raw, record_time_s in bar:
                builders[topic].add(message_type, raw, record_time_s)
            tables = {}
            for topic in chosen:
                tables[topic] = builders.pop(topic).table()
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
