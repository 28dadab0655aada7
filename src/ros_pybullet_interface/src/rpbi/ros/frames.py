"""Names of TF frames."""

from __future__ import annotations

_prefix = ""


def use_prefix(prefix: str | None) -> None:
    """Puts a prefix before all frames of this node's world, so that two worlds can share one TF tree."""
    global _prefix
    _prefix = f"{prefix}/" if prefix else ""


def prefixed(frame: str) -> str:
    """Returns the full name of a frame of this node's world, such as `rpbi/kuka_lwr`."""
    return _prefix + frame


def world_frame() -> str:
    """Returns the frame that all poses are in: `rpbi/world`, with the prefix if there is one."""
    return prefixed("rpbi/world")
