"""Measures topics in bags of episodes, reads episodes into tables, and repairs bags after a recorder was killed."""

from __future__ import annotations

import hashlib
import logging
import math
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from custom_ros_tools.foreign import printable
from rpbi_data.bags.bag_reader import BagReader, bag_to_dataframes
from rpbi_data.bags.limits import BASE_TIME_S, TIME_PER_MB_S, BagError
from rpbi_data.bags.times import MAX_BACK_S
from rpbi_data.bags.topic_report import topic_report

from .errors import DISK_FULL, EpisodeError
from .folder import BAG, FACTS, FARM, SEAL, SET_BACK, UNREADABLE, Episode, EpisodeFolder, file_in, hold, read_part

REINDEX_BYTES = 2**31
"""Largest address space of the process that indexes a bag [bytes]."""
MAX_CLOSE_S = 2.0
"""Longest time to wait for the writing process of a killed recorder to close the bag [s]."""

EPISODE = "episode"
"""Name of the first index level in tables of several episodes."""

_log = logging.getLogger(__name__)


def measure_topics(bag: Path, *, any_size: bool = True) -> dict[str, dict[str, Any]]:
    """Measures the topics of a bag, for the attribute `topics` of an `Episode`.

    Args:
        bag: Path of the bag.
        any_size: Whether the bag may exceed the limits of `BagReader`.

    Returns:
        Properties of each topic, indexed by topic: `type`, number of `messages`, mean rate `rate_hz` [Hz], longest gap
        `max_gap_s` [s], and `sha256`, see `seals_of`. A rate of 0 means that the rate is unknown. If the
        clock of a topic was set back by more than 1 s, the topic also has `set_back_s` [s].

    Raises:
        BagError: If the bag cannot be read.
    """
    report, seals = topic_report(bag, any_size=any_size), seals_of(bag, any_size=any_size)
    return {
        str(topic): {
            "type": str(row["type"]),
            "messages": int(row["messages"]),
            "rate_hz": 0.0 if math.isnan(row["rate_hz"]) else float(row["rate_hz"]),
            "max_gap_s": float(row["max_gap_s"]),
            SEAL: seals[str(topic)],
            **({SET_BACK: float(row["set_back_s"])} if row["set_back_s"] > MAX_BACK_S else {}),
        }
        for topic, row in report.iterrows()
    }


def seals_of(bag: Path, *, any_size: bool = True) -> dict[str, str]:
    """Returns the seal of each topic in a bag: the SHA-256 of all messages and their recording times.

    Args:
        bag: Path of the bag.
        any_size: Whether the bag may exceed the limits of `BagReader`.

    Raises:
        BagError: If the bag cannot be read.
    """
    digests: dict[str, Any] = {}
    with BagReader(bag, any_size) as opened:
        for message in opened.messages(opened.types):
            digest = digests.setdefault(message.topic, hashlib.sha256())
            digest.update(b"%d %d\n" % (message.record_time_ns, len(message.raw)))
            digest.update(message.raw)
    return {topic: digest.hexdigest() for topic, digest in digests.items()}


def episodes_to_dataframes(
    path: str | Path, topics: str | Iterable[str] | None = None, *, images: bool = False, any_size: bool = False
) -> dict[str, pd.DataFrame]:
    """Reads all episodes of a folder into tables, one per topic.

    Args:
        path: The folder of episodes.
        topics: Topics to read: names, or one name. By default all topics without binary data.
        images: Whether the default includes topics with binary data.
        any_size: See `rpbi_data.bag_to_dataframes`.

    Returns:
        Tables as returned by `bag_to_dataframes`, but with the index levels `episode` and `time`. If an episode lacks a
        topic, the topic's table has no rows of this episode. Episodes that cannot be read are left out, with a warning.

    Raises:
        EpisodeError: If the folder does not exist, or no episode can be read.
        UnknownNameError: If none of the episodes has a given topic.
    """
    folder = EpisodeFolder(path)
    wanted = None if topics is None else {topics} if isinstance(topics, str) else set(topics)
    tables: dict[str, dict[int, pd.DataFrame]] = {}
    known: set[str] = set()
    faults: list[str] = []
    for episode in folder.all():
        if episode.state == UNREADABLE:
            faults.append(f"{folder.folder_of(episode.number) / FACTS}: {UNREADABLE}: {episode.note}")
        known |= episode.topics.keys()
        chosen = None if wanted is None else sorted(wanted & episode.topics.keys())
        if not episode.topics or chosen == []:
            continue
        place = folder.folder_of(episode.number)
        try:
            bag = file_in(place, BAG) or place / BAG
            found = bag_to_dataframes(bag, chosen, images=images, any_size=any_size)
        except InterfaceError as error:
            faults.append(str(error))
            continue
        for topic, table in found.items():
            tables.setdefault(topic, {})[episode.number] = table
    for fault in faults:
        _log.warning("left out: %s", printable(fault))
    if faults and not tables:
        raise EpisodeError(folder.path, f"no episode can be read: {'; '.join(faults)}")
    for topic in sorted((wanted or set()) - known):
        raise UnknownNameError("topic", topic, known)
    return {topic: pd.concat(tables[topic], names=[EPISODE]) for topic in sorted(tables)}


def repair_all(folder: EpisodeFolder) -> Iterator[str]:
    """Completes all episodes whose recorder was killed, and yields a message for each of these episodes.

    Episodes that another process is recording are skipped.

    Raises:
        EpisodeError: If the folder belongs to a farm. Farms do not repair episodes, but make them again.
    """
    if os.path.lexists(folder.path / FARM):
        message = "expected episodes of a recorder, these are of a farm: it makes them again itself"
        raise EpisodeError(folder.path, message)
    for part in folder.partial():
        try:
            handle = hold(part, MAX_CLOSE_S)
        except BlockingIOError:
            yield f"{part.name} is being recorded by another process, and left alone"
            continue
        except OSError as error:
            yield f"{part} cannot be repaired: {error.strerror or error}"
            continue
        try:
            episode = repair(folder, part)
            yield f"episode {episode.number}: {episode.state}: {episode.note}"
        except (EpisodeError, OSError) as error:
            yield f"{part} cannot be repaired: {error}"
        finally:
            os.close(handle)


def repair(folder: EpisodeFolder, part: Path) -> Episode:
    """Completes an episode whose recorder was killed, and renames its temporary folder to the final name.

    After an error, the episode stays in the temporary folder.

    Args:
        folder: The folder of episodes.
        part: Temporary folder of the episode.

    Returns:
        The episode. Its state is `recovered`, or `incomplete` if no message could be recovered.

    Raises:
        OSError: If the episode cannot be written.
        EpisodeError: If the bag is a link, a pipe or a device, or has several hard links.
    """
    episode = read_part(part)
    fault = f"; {episode.note}" if episode.state == UNREADABLE else ""
    bag = part / BAG
    active = file_in(part, f"{BAG}.active")
    if active is not None:
        active.rename(bag)
    if file_in(part, BAG) is not None and bag.stat().st_nlink > 1:
        raise EpisodeError(bag, "expected a file with one name, got one with several hard links")
    episode.state = "recovered"
    try:
        if not bag.exists():
            raise BagError(bag, "there is none")
        if not _is_complete(bag):
            _reindex(bag)
        episode.topics = measure_topics(bag, any_size=False)
        episode.note = f"the recorder was killed, {episode.messages} messages recovered"
        sent = sum(episode.published.values())
        if sent:
            episode.note += f" of {sent} sent to it until at most 1 s before"
    except Exception as error:  # rosbag has errors of all kinds for a broken file
        if getattr(error, "errno", None) in DISK_FULL:
            raise
        episode.state = "incomplete"
        episode.note = f"the recorder was killed, no message recovered: {' '.join(str(error).split())}"
    episode.note += fault
    folder.complete(part, episode)
    return episode


def _is_complete(bag: Path) -> bool:
    try:
        with BagReader(bag):
            return True
    except BagError:
        return False


_REINDEX = """
import resource, sys
import rosbag
path, memory, seconds = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
try:
    with rosbag.Bag(path, "a", allow_unindexed=True) as bag:
        for _ in bag.reindex():
            pass
except OSError as error:
    sys.exit(error.errno or 1)
except Exception as error:
    sys.exit(f"{type(error).__name__}: {error}")
"""


def _reindex(bag: Path) -> None:
    """Writes the index of a bag, in a separate process with limits, since rosbag trusts the sizes in a damaged bag.

    Raises:
        BagError: If the bag cannot be indexed, or indexing needs too much memory or time.
        OSError: If the index cannot be written.
    """
    seconds = BASE_TIME_S + TIME_PER_MB_S * bag.stat().st_size / 1e6
    words = [str(bag), str(REINDEX_BYTES), str(math.ceil(seconds))]
    done = subprocess.run([sys.executable, "-c", _REINDEX, *words], capture_output=True, text=True)
    if done.returncode in DISK_FULL:
        raise OSError(done.returncode, os.strerror(done.returncode), str(bag))
    if done.returncode:
        said = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise BagError(bag, f"cannot be indexed: {printable(said[0], 300)}")
