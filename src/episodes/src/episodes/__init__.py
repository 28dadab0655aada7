"""Demonstrations as episodes: recorded, listed, read as one table, and verified.

The names in `__all__` can be imported from here; each is loaded when it is used, ROS included.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from episodes.folder import EpisodeFolder
    from episodes.ros.bags import episodes_to_dataframes

__all__ = ["EpisodeFolder", "episodes_to_dataframes"]

_HOMES = {"EpisodeFolder": "episodes.folder", "episodes_to_dataframes": "episodes.ros.bags"}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
