"""Measures the topics of a bag: number, size, rate and gaps of the messages."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .bag_reader import BagMessage, BagReader
from .times import PER_SECOND, ClockStep, set_back, to_seconds

Array = NDArray[Any]

_STAMP = struct.Struct("<4xII")  # skips the `seq` of a header
_COLUMNS = ("type", "messages", "bytes", "rate_hz", "max_gap_s", "set_back_s", "first", "last")


class TopicReport(pd.DataFrame):
    """A DataFrame that is printed with all rows and columns. Tables derived from it are ordinary DataFrames."""

    def __repr__(self) -> str:
        return self.to_string()


def topic_report(path: str | Path, any_size: bool = False) -> TopicReport:
    """Measures number, size and rate of the messages of every topic in a bag.

    The time of a message is the stamp of its header, or the recording time if the message has no stamp, as on `/tf`.

    Args:
        path: A `.bag` file with any compression.
        any_size: Whether the bag may unpack to more than both 1 GiB and 255 times its file size.

    Returns:
        A table with one row per topic, whose index is the topic, sorted by name. The columns are:

        - `type`: message type,
        - `messages`: number of messages,
        - `bytes`: size of the serialised messages before compression,
        - `rate_hz`: mean rate from the first to the last message; NaN if both have the same time,
        - `max_gap_s`: longest time between two successive messages,
        - `set_back_s`: largest backward step of times in the order of recording,
        - `first`, `last`: ROS time of the first and the last message [s].

    Raises:
        BagError: If the file does not exist, is not a complete bag, or exceeds a limit.
    """
    with BagReader(path, any_size) as bag:
        times: dict[str, list[int]] = {topic: [] for topic in bag.types}
        sizes = dict.fromkeys(bag.types, 0)
        for message in bag.messages(list(bag.types)):
            times[message.topic].append(message_time_ns(message))
            sizes[message.topic] += len(message.raw)
        rows = [
            (
                "|".join(sorted({each.name for each in types})),
                len(times[topic]),
                sizes[topic],
                *_rhythm(to_seconds(times[topic]), bag.clock_of(topic)),
            )
            for topic, types in bag.types.items()
        ]
        return TopicReport(rows, index=pd.Index(list(bag.types), name="topic"), columns=_COLUMNS)


def message_time_ns(message: BagMessage) -> int:
    """Returns the stamp of a message [ns]; without a stamp, the recording time."""
    if not message.type.has_header or len(message.raw) < _STAMP.size:
        return message.record_time_ns
    seconds, nanoseconds = _STAMP.unpack_from(message.raw)
    return seconds * PER_SECOND + nanoseconds or message.record_time_ns


def message_time(message: BagMessage) -> float:
    """Returns the stamp of a message [s]; without a stamp, the recording time."""
    return float(to_seconds(message_time_ns(message)))


def _rhythm(times: Array, clock: ClockStep) -> tuple[float, float, float, float, float]:
    """Returns mean rate [Hz], longest gap [s], largest backward step [s], first time [s] and last time [s]."""
    back_s = max(set_back(times).back_s, clock.back_s)
    ordered = np.sort(times)
    first, last = ordered[0], ordered[-1]
    rate_hz = (len(ordered) - 1) / (last - first) if last > first else np.nan
    return rate_hz, np.diff(ordered).max(initial=0.0), back_s, first, last
