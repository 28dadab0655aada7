"""Main configurations for the simulator node, and what tests often ask it."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import yaml
from cob_srvs.srv import SetString
from diagnostic_msgs.msg import DiagnosticArray
from ros_system import wait_until
from rosgraph_msgs.msg import Log
from worlds import write_world

from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject, ListObjects

SECTIONS = ("visual_objects", "collision_objects", "dynamic_objects", "robots", "soft_objects", "urdfs")


def main_config(folder: Path, **parts: Any) -> dict[str, Any]:
    """Returns the main configuration of a world, as `~config` takes it; see `write_world` for the arguments."""
    config = yaml.safe_load(Path(write_world(folder, **parts)).read_text())
    for section in set(SECTIONS) & set(config):
        config[section] = [str(folder / name) for name in config[section]]
    return config


def add(ros: Any, kind: int = PybulletObject.DYNAMIC, config: Any = "", filename: str = "", ns: str = "/") -> Any:
    """Asks for an object; `config` may be a mapping or YAML text."""
    text = config if isinstance(config, str) else yaml.safe_dump(config)
    return ros.call(f"{ns}rpbi/add_pybullet_object", AddPybulletObject, PybulletObject(kind, filename, text))


def remove(ros: Any, name: str, ns: str = "/") -> Any:
    """Asks for the removal of an object."""
    return ros.call(f"{ns}rpbi/remove_pybullet_object", SetString, name)


def objects(ros: Any, ns: str = "/") -> dict[str, str]:
    """Returns the types of all objects by name."""
    answer = ros.call(f"{ns}rpbi/list_objects", ListObjects)
    return dict(zip(answer.names, answer.types, strict=True))


@contextmanager
def publishing(topic: str, message_type: type) -> Iterator[rospy.Publisher]:
    """Publishes a topic that somebody listens to; none of the messages is lost when it ends."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # without a queue, a message has gone when `publish` returns
        publisher = rospy.Publisher(topic, message_type, queue_size=None)
    try:
        wait_until(publisher.get_num_connections, f"somebody listens to {topic}")
        yield publisher
    finally:
        publisher.unregister()


def count_taken(publisher: rospy.Publisher) -> int:
    """Returns how many messages of a publisher each of those who listen has read; services may answer sooner."""
    master, topic = rosgraph.Master(rospy.get_name()), publisher.resolved_name
    counts = []
    for node in dict(master.getSystemState()[1]).get(topic, []):
        with suppress(ConnectionRefusedError):  # one that was killed stays registered
            _, _, (_, subscriptions, *_) = ServerProxy(master.lookupNode(node)).getBusStats(rospy.get_name())
            counts += [read for name, connections in subscriptions if name == topic for _, _, read, *_ in connections]
    return min(counts, default=0)


def registrations(node: str = "/ros_pybullet_interface") -> list[tuple[str, ...]]:
    """Returns all that a node has at the master."""
    kinds = ("publishes", "subscribes", "serves")
    state = rosgraph.Master("/tests").getSystemState()
    return sorted(
        (kind, name) for kind, entries in zip(kinds, state, strict=True) for name, nodes in entries if node in nodes
    )


def diagnosed(message: DiagnosticArray) -> dict[str, str]:
    """Returns the values in a message of the simulator's diagnostics."""
    return {pair.key: pair.value for pair in message.status[0].values}


def count(process_id: int, what: str) -> int:
    """Returns how many threads (`task`) or open files (`fd`) a process has."""
    return len(os.listdir(f"/proc/{process_id}/{what}"))


def resident_mb(process_id: int) -> float:
    """Returns the memory that a process holds [MB]."""
    pages = int(Path(f"/proc/{process_id}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Rosout:
    """What nodes say on /rosout: all others, or the tests' own process alone."""

    def __init__(self, ros: Any, own: bool = False) -> None:
        self._listener, self._own = ros.listen("/rosout", Log), own

    def wait_to_hear(self, node: str) -> None:
        """Waits until what a node says is heard: what it says before is lost."""
        wait_until(lambda: self._listener.hears(node), f"/rosout of {node} is heard")

    def logs(self, containing: str = "") -> list[Log]:
        """Returns the messages that contain a text; one that is published while we connect comes again, as latched."""
        logs = {
            (log.name, log.header.stamp.to_nsec(), log.msg): log
            for log in list(self._listener.messages)
            if containing in log.msg and (log.name == rospy.get_name()) == self._own
        }
        return list(logs.values())

    def is_throttled(self, text: str) -> bool:
        """Whether a warning came once; one that comes after the 5 s of its throttle says how many were kept back."""
        return all("more like it since the last warning" in log.msg for log in self.logs(text)[1:])

    def wait_for(self, texts: Sequence[str], timeout_s: float = 60.0) -> None:
        """Waits until messages that contain these texts have come."""
        wait_until(
            lambda: all(self.logs(text) for text in texts),
            f"/rosout has {[text for text in texts if not self.logs(text)]}",
            timeout_s,
        )
