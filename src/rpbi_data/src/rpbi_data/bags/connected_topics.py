"""Queries connections between nodes, and the connections' message counts, through the nodes' XML-RPC interfaces."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any
from xmlrpc.client import ServerProxy

import rosgraph

from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, TimedTransport

_CALLER = "/rpbi_utils"
_ANSWER_S = 1.0
"""Longest time to wait for an answer [s]."""
_OUTBOUND = "o"


def find_unconnected(node: str, topics: Collection[str]) -> tuple[list[str], list[str]]:
    """Returns the topics to which a node has not subscribed yet, and the publishers that are not connected to the node.

    Subscriptions are read from the master. When the node has subscribed to all topics, the publishers are queried,
    since only publishers know whether a subscriber is connected. A publisher is listed as `"/publisher (/topic)"`.
    Publishers that do not answer are listed, too, unless their process has ended.

    Args:
        node: Full name of the subscribing node.
        topics: Full names of the topics.

    Raises:
        OSError: If the master cannot be reached.
    """
    master = rosgraph.Master(_CALLER)
    publishers, subscribers, _ = master.getSystemState()
    unsubscribed = set(topics).difference(topic for topic, nodes in subscribers if node in nodes)
    if unsubscribed:
        return sorted(unsubscribed), []
    wanted: dict[str, list[str]] = {}
    for topic, nodes in publishers:
        if topic in topics:
            for publisher in nodes:
                wanted.setdefault(publisher, []).append(topic)
    silent = []
    for publisher, published in wanted.items():
        try:
            uri = master.lookupNode(publisher)  # here, an error means that the master cannot be reached
        except rosgraph.MasterError:  # the publisher has just ended
            continue
        try:
            connected = _topics_sent(uri, node)
        except ConnectionRefusedError:  # the publisher ended without an answer
            continue
        silent += [f"{publisher} ({topic})" for topic in published if topic not in connected]
    return [], silent


def count_sent(node: str, topics: Collection[str]) -> dict[str, int]:
    """Returns how many messages publishers of given topics have sent to a node, indexed by topic.

    Publishers that do not answer are left out. If the master does not answer, the result is empty.
    """
    counts: dict[str, int] = {}
    try:
        publishers = rosgraph.Master(_CALLER).getSystemState()[0]
        nodes = {each for topic, names in publishers if topic in topics for each in names}
        uris = [rosgraph.Master(_CALLER).lookupNode(each) for each in nodes]
    except (OSError, rosgraph.MasterException):
        return counts
    for uri in uris:
        for topic, count in _count_sent_by(uri, node).items():
            counts[topic] = counts.get(topic, 0) + count
    return counts


def count_received(node: str) -> dict[str, int] | None:
    """Returns how many messages a rospy node has received, indexed by topic; None if the node does not answer."""
    try:
        uri = rosgraph.Master(_CALLER).lookupNode(node)
        _, subscribers, _ = _node(uri).getBusStats(_CALLER)[2]
    except (*MASTER_FAILURES, rosgraph.MasterException):
        return None
    return {topic: sum(each[2] for each in connections) for topic, connections in subscribers}


def _topics_sent(uri: str, node: str) -> set[str]:
    """Returns the topics on which the node at `uri` sends to `node`; empty if the node at `uri` does not answer."""
    try:
        _, _, connections = _node(uri).getBusInfo(_CALLER)
    except ConnectionRefusedError:
        raise
    except MASTER_FAILURES:
        return set()
    # id, other end, direction, transport, topic, whether connected
    return {topic for _, other, way, _, topic, *_ in connections if other == node and way == _OUTBOUND}


def _count_sent_by(uri: str, node: str) -> dict[str, int]:
    """Returns how many messages the node at `uri` has sent to `node`, indexed by topic; empty without an answer."""
    other_end = _node(uri)
    try:
        connections = other_end.getBusInfo(_CALLER)[2]
        answer = other_end.getBusStats(_CALLER)
    except MASTER_FAILURES:
        return {}
    chosen = {each[0] for each in connections if each[1] == node and each[2] == _OUTBOUND}
    if isinstance(answer[0], list):  # roscpp: no code and message; the count follows two sizes
        publishers = [(topic, {each[0]: each[3] for each in rows}) for topic, rows in answer[0]]
    else:
        publishers = [(topic, {each[0]: each[2] for each in rows}) for topic, _, rows, *_ in answer[2][0]]
    counts = {topic: sum(by_id[each] for each in chosen & by_id.keys()) for topic, by_id in publishers}
    return {topic: count for topic, count in counts.items() if count}


def _node(uri: str) -> Any:
    return ServerProxy(uri, TimedTransport(_ANSWER_S))
