"""Tools around the simulator.

The names in `__all__` are those of `rpbi_data`, and are loaded from there when they are used.
"""

from typing import Any

import rpbi_data

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
]  # noqa: F822


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(rpbi_data, name)
