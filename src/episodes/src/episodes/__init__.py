"""Former name of parts of the package `rpbi_data`, kept for existing imports."""

from typing import Any

import rpbi_data

__all__ = ["EpisodeFolder", "episodes_to_dataframes"]  # noqa: F822


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(rpbi_data, name)
