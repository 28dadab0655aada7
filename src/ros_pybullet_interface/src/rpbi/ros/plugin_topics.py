"""Topics that classes of other packages name."""

from __future__ import annotations

from typing import Any

from custom_ros_tools.errors import ConfigError, Problem

from ..plugins import find, full_name


def find_topic(name: str, kind: type, owner: Any) -> Any:
    """Returns a topic of another package.

    Args:
        name: Where it is, as `module:NAME`.
        kind: What it should be: SampleTopic or TopicInput.
        owner: The sensor or body that names it as its `ros_topic`.

    Raises:
        ConfigError: If there is no such thing; it names the class of the owner.
    """
    try:
        found = find(name)
        if not isinstance(found, kind):
            raise ValueError(f"expected a {full_name(kind)} in '{name}', got {found!r}")
    except ValueError as error:
        raise ConfigError([Problem(full_name(owner), "ros_topic", str(error))]) from None
    return found
