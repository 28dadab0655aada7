"""A folder of episodes as tables."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from episodes.errors import EpisodeError
from episodes.folder import BAG, FACTS, UNREADABLE, EpisodeFolder, file_in
from rpbi_utils.ros.bags.dataframes import bag_to_dataframes

EPISODE = "episode"

_log = logging.getLogger(__name__)


def episodes_to_dataframes(
    path: str | Path, topics: str | Iterable[str] | None = None, *, images: bool = False, any_size: bool = False
) -> dict[str, pd.DataFrame]:
    """Reads all episodes of a folder into tables, one a topic.

    Args:
        path: The folder.
        topics: Names of topics, or one name; by default all without binary data.
        images: Whether to include those with binary data.
        any_size: See `rpbi_utils.bag_to_dataframes`.

    Returns:
        Tables as `bag_to_dataframes` returns them, with the index (`episode`, `time`). An episode without a topic has
        no rows in its table. One that cannot be read is left out, with a warning.

    Raises:
        EpisodeError: If there is no such folder, or no episode can be read.
        UnknownNameError: If no episode has a topic that was named.
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
        _log.warning("left out: %s", fault)
    if faults and not tables:
        raise EpisodeError(folder.path, f"no episode can be read: {'; '.join(faults)}")
    for topic in sorted((wanted or set()) - known):
        raise UnknownNameError("topic", topic, known)
    return {topic: pd.concat(tables[topic], names=[EPISODE]) for topic in sorted(tables)}
