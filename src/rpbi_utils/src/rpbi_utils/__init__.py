"""Tools for the simulator: console commands, windows, tracking, interpolation and an emulated driver.

The names in `__all__` are re-exported from `rpbi_data`.
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
