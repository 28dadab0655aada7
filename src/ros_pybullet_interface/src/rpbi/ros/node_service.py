"""A service of the node."""

from __future__ import annotations

from typing import NamedTuple


class NodeService(NamedTuple):
    """What a service of the node is.

    Attributes:
        service_type: Its ROS type.
        meaning: What it does, in a sentence.
    """

    service_type: type
    meaning: str
