"""A folder of episodes as tables."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from custom_ros_tools.errors import UnknownNameError
from episodes.folder import BAG, EpisodeFolder
from rpbi_utils.ros.bags.dataframes import bag_to_dataframes

EPISODE = "episode"


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
        no rows in its table.

    Raises:
        EpisodeError: If there is no such folder, or an episode cannot be read.
        BagError: If a bag cannot be read.
        UnknownNameError: If no episode has a topic that was named.
    """
    folder = EpisodeFolder(path)
    wanted = None if topics is None else {topics} if isinstance(topics, str) else set(topics)
    tables: dict[str, dict[int, pd.DataFrame]] = {}
    known: set[str] = set()
    for episode in folder.all():
        known |= episode.topics.keys()
        chosen = None if wanted is None else sorted(wanted & episode.topics.keys())
        if not episode.topics or chosen == []:
            continue
        bag = folder.folder_of(episode.number) / BAG
        for topic, table in bag_to_dataframes(bag, chosen, images=images, any_size=any_size).items():
            tables.setdefault(topic, {})[episode.number] = table
    for topic in sorted((wanted or set()) - known):
        raise UnknownNameError("topic", topic, known)
    return {topic: pd.concat(tables[topic], names=[EPISODE]) for topic in sorted(tables)}
