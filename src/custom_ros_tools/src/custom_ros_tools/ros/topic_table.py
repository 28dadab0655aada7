"""The table of a ROS system's topics, for the browser view, the Foxglove bridge and the ROS 2 bridge.

The table asks the ROS master once a second and subscribes to nothing. It therefore has the topics of every node.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any
from xmlrpc.client import MultiCall

import rospy

from .lifecycle.timed_master import MASTER_FAILURES, timed_master
from .lifecycle.wall_time import WallTimer

LOOK_HZ = 1.0
"""Rate of questions to the ROS master [Hz]."""
UNKNOWN_TYPE = "*"
"""Type that the master has of a topic if no node has said a type."""


@dataclass(frozen=True)
class TopicRow:
    """A topic that at least one node publishes.

    Attributes:
        name: Full name.
        type: Message type, such as `sensor_msgs/JointState`; `UNKNOWN_TYPE` if the master has none.
        publishers: Names of the nodes that publish the topic.
        is_latched: Whether new subscribers receive the last message; None until `TopicTable.learn` was called.
    """

    name: str
    type: str
    publishers: frozenset[str]
    is_latched: bool | None = None


OnChange = Callable[[TopicRow | None, TopicRow | None], None]
"""Called with the former and the new row of a topic; None stands for a topic without publishers."""


@dataclass(frozen=True)
class SystemState:
    """The nodes behind each name, as the ROS master has them.

    Attributes:
        publishers: Names of publishing nodes, indexed by topic.
        subscribers: Names of subscribing nodes, indexed by topic.
        providers: Names of serving nodes, indexed by service.
        types: Message types, indexed by topic; also of topics that nobody publishes.
    """

    publishers: Mapping[str, frozenset[str]]
    subscribers: Mapping[str, frozenset[str]]
    providers: Mapping[str, frozenset[str]]
    types: Mapping[str, str]


class TopicTable:
    """Rows of all topics that are published. Thread-safe. Call `look` at any time, or `watch` once.

    While the master is unreachable, the table keeps its rows.

    Args:
        on_change: Called, in the thread of `look` or `learn`, for each topic that appears, changes or disappears. If
            it raises an error, the topic's row stays as it was, so that the next `look` calls it again.
    """

    def __init__(self, on_change: OnChange = lambda before, after: None) -> None:
        self._on_change = on_change
        self._lock = threading.RLock()
        self._rows: dict[str, TopicRow] = {}
        self._state = SystemState({}, {}, {}, {})
        self._timer: WallTimer | None = None

    @property
    def rows(self) -> dict[str, TopicRow]:
        """The rows, indexed by topic."""
        with self._lock:
            return dict(self._rows)

    @property
    def state(self) -> SystemState:
        """The answer of the master to the last question."""
        with self._lock:
            return self._state

    def watch(self, hz: float = LOOK_HZ) -> None:
        """Asks the master at once, and then at a fixed rate [Hz] in a thread, until `close` or the node's shutdown."""
        self.look()
        self._timer = WallTimer(hz, self.look)

    def close(self) -> None:
        """Stops asking the master."""
        if self._timer is not None:
            self._timer.stop()

    def look(self) -> None:
        """Asks the master, and updates the rows."""
        try:
            with timed_master() as master:
                calls: Any = MultiCall(master)
                calls.getSystemState(rospy.get_name())
                calls.getTopicTypes(rospy.get_name())
                (_, _, lists), (_, _, pairs) = calls()
        except MASTER_FAILURES:
            return
        types = dict(pairs)
        publishers_of, subscribers_of, providers_of = map(_by_name, lists)
        state = SystemState(publishers_of, subscribers_of, providers_of, types)
        with self._lock:
            self._state = state
            for name in self._rows.keys() - state.publishers.keys():
                self._set(name, None)
            for name, publishers in state.publishers.items():
                row = TopicRow(name, types.get(name, UNKNOWN_TYPE), publishers)
                before = self._rows.get(name)
                if before is not None and before.type == row.type:
                    row = replace(row, is_latched=before.is_latched)
                self._set(name, row)

    def learn(self, name: str, header: Mapping[str, str]) -> None:
        """Notes whether a topic is latched; call it with the header of a connection to a publisher of the topic."""
        with self._lock:
            row = self._rows.get(name)
            if row is not None:
                self._set(name, replace(row, is_latched=bool(row.is_latched) or header.get("latching") == "1"))

    def _set(self, name: str, row: TopicRow | None) -> None:
        before = self._rows.get(name)
        if row == before:
            return
        self._on_change(before, row)
        if row is None:
            del self._rows[name]
        else:
            self._rows[name] = row


def _by_name(pairs: Iterable[tuple[str, list[str]]]) -> dict[str, frozenset[str]]:
    return {name: frozenset(nodes) for name, nodes in pairs if nodes}
