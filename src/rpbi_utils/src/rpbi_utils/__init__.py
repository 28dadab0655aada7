"""Tools around the simulator: recording and tables.

`bag_to_dataframes`, `topic_report` and `Recorder` can be imported from here; ROS is loaded when one is.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rpbi_utils.ros.bags import bag_to_dataframes
    from rpbi_utils.ros.recorder import Recorder
    from rpbi_utils.ros.topic_report import topic_report

__all__ = ["Recorder", "bag_to_dataframes", "topic_report"]

_HOMES = {
    "Recorder": "rpbi_utils.ros.recorder",
    "bag_to_dataframes": "rpbi_utils.ros.bags",
    "topic_report": "rpbi_utils.ros.topic_report",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
