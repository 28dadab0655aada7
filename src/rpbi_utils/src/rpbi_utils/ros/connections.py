"""Who is connected to whom, as the master and the nodes themselves tell it."""

from __future__ import annotations

import http.client
from collections.abc import Collection
from typing import Any
from xmlrpc.client import Error, ServerProxy

import rosgraph

from custom_ros_tools.ros.lifecycle.timed_master import TimedTransport

_CALLER = "/rpbi_utils"
_TIMEOUT_S = 1.0
_OUTBOUND = "o"


def unsubscribed(node: str, topics: Collection[str]) -> list[str]:
    """Returns those of some topics to which a node has not subscribed at the master.

    Raises:
        OSError: If the master cannot be reached.
    """
    _, subscribers, _ = rosgraph.Master(_CALLER).getSystemState()
    subscribed = {topic for topic, nodes in subscribers if node in nodes}
    return [topic for topic in topics if topic not in subscribed]


def unconnected(node: str, topics: Collection[str]) -> list[str]:
    """Returns the publishers of some topics that do not send to a node yet, as `"/publisher (/topic)"`.

    The publishers are asked, since only they know when a subscriber gets what they publish. One that is
    registered but gone is not counted; one that does not answer is.

    Raises:
        OSError: If the master cannot be reached.
    """
    master = rosgraph.Master(_CALLER)
    publishers, _, _ = master.getSystemState()
    wanted: dict[str, list[str]] = {}
    for topic, nodes in publishers:
        if topic in topics:
            for publisher in nodes:
                wanted.setdefault(publisher, []).append(topic)
    missing = []
    for publisher, published in wanted.items():
        try:
            connected = _receivers(master.lookupNode(publisher), node)
        except (ConnectionRefusedError, rosgraph.MasterError):  # it ended without a word, or just now
            continue
        missing += [f"{publisher} ({topic})" for topic in published if topic not in connected]
    return missing


def _receivers(uri: str, node: str) -> set[str]:
    """Returns the topics that the node at `uri` sends to `node`; none if it does not answer."""
    proxy: Any = ServerProxy(uri, TimedTransport(_TIMEOUT_S))
    try:
        _, _, connections = proxy.getBusInfo(_CALLER)
    except ConnectionRefusedError:
        raise
    except (OSError, Error, http.client.HTTPException):
        return set()
    # id, other end, direction, transport, topic, whether connected
    return {topic for _, other, way, _, topic, *_ in connections if other == node and way == _OUTBOUND}
