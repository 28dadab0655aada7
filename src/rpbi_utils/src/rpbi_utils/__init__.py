"""Tools around the simulator: recording and tables.

The names in `__all__` can be imported from here; each is loaded when it is used, ROS included.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rpbi_utils.bags.resampling import align, resample
    from rpbi_utils.bags.transforms import transforms_between
    from rpbi_utils.ros.bags.dataframes import bag_to_dataframe, bag_to_dataframes
    from rpbi_utils.ros.bags.images import bag_to_images, write_images, write_video
    from rpbi_utils.ros.bags.recorder import Recorder
    from rpbi_utils.ros.bags.topic_report import topic_report

__all__ = [
    "Recorder",
    "align",
    "bag_to_dataframe",
    "bag_to_dataframes",
    "bag_to_images",
    "resample",
    "topic_report",
    "transforms_between",
    "write_images",
    "write_video",
]

_HOMES = {
    "Recorder": "rpbi_utils.ros.bags.recorder",
    "align": "rpbi_utils.bags.resampling",
    "bag_to_dataframe": "rpbi_utils.ros.bags.dataframes",
    "bag_to_dataframes": "rpbi_utils.ros.bags.dataframes",
    "bag_to_images": "rpbi_utils.ros.bags.images",
    "resample": "rpbi_utils.bags.resampling",
    "topic_report": "rpbi_utils.ros.bags.topic_report",
    "transforms_between": "rpbi_utils.bags.transforms",
    "write_images": "rpbi_utils.ros.bags.images",
    "write_video": "rpbi_utils.ros.bags.images",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
