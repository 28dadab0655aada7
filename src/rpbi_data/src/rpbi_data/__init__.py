"""Records bags, and makes tables, replays, episodes and data sets from bags.

The names in `__all__` can be imported from this package. Submodules and ROS are only loaded when a name is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rpbi_data.bags.bag_reader import bag_to_dataframe, bag_to_dataframes
    from rpbi_data.bags.images import bag_to_images, write_images, write_video

    from .bags.recorded_topics import Recorder
    from .bags.resampling import align, resample
    from .bags.topic_report import topic_report
    from .bags.transforms import transforms_between
    from .episodes.bags import episodes_to_dataframes
    from .episodes.folder import EpisodeFolder

__all__ = [
    "EpisodeFolder",
    "Recorder",
    "align",
    "bag_to_dataframe",
    "bag_to_dataframes",
    "bag_to_images",
    "episodes_to_dataframes",
    "resample",
    "topic_report",
    "transforms_between",
    "write_images",
    "write_video",
]

_HOMES = {
    "EpisodeFolder": "rpbi_data.episodes.folder",
    "Recorder": "rpbi_data.bags.recorded_topics",
    "align": "rpbi_data.bags.resampling",
    "bag_to_dataframe": "rpbi_data.bags.bag_reader",
    "bag_to_dataframes": "rpbi_data.bags.bag_reader",
    "bag_to_images": "rpbi_data.bags.images",
    "episodes_to_dataframes": "rpbi_data.episodes.bags",
    "resample": "rpbi_data.bags.resampling",
    "topic_report": "rpbi_data.bags.topic_report",
    "transforms_between": "rpbi_data.bags.transforms",
    "write_images": "rpbi_data.bags.images",
    "write_video": "rpbi_data.bags.images",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
