"""Former package of episodes, kept for existing imports. The names in `__all__` are loaded from `rpbi_data` on use."""

from typing import Any

import rpbi_data

__all__ = ["EpisodeFolder", "episodes_to_dataframes"]  # noqa: F822


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(rpbi_data, name)
