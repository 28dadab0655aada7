"""Finds and stops simulators that already run on the ROS master of a new launch."""

import time
from collections.abc import Iterable, Set
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from xmlrpc.client import ServerProxy

import rosgraph
import roslaunch.config

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, TIMEOUT_S, TimedTransport

MAX_END_S = 60.0
"""Timeout for the end of a simulator and its `roslaunch` [s]."""
_CALLER = "/rpbi_launch"
_PACKAGE = "ros_pybullet_interface"
_LIST = "rpbi/list_objects"
"""A service that every simulator has. Other nodes do not have the service."""
_POLL_S = 0.1


class RunningNode(NamedTuple):
    """A running ROS node.

    Attributes:
        name: Full name of the node.
        uri: Address of the node's XML-RPC interface.
    """

    name: str
    uri: str

    def stop(self, master: str) -> None:
        """Stops the node and waits until the node has ended.

        If the `roslaunch` that started the node runs on this machine, also waits until this `roslaunch` has ended.

        Args:
            master: Address of the node's ROS master. The master may end together with `roslaunch`.

        Raises:
            InterfaceError: If the node or its `roslaunch` does not end within `MAX_END_S`.
        """
        launch = self._launch_process(master)
        end_s = time.monotonic() + MAX_END_S
        with suppress(*MASTER_FAILURES):  # it may end before it answers
            _proxy(self.uri).shutdown(_CALLER, "replaced by another simulator")
        while _answers(self.uri) or (launch is not None and _is_running(launch)):
            if time.monotonic() > end_s:
                raise InterfaceError(f"{self.name} at {self.uri} did not end within {MAX_END_S:g} s")
            time.sleep(_POLL_S)

    def _launch_process(self, master: str) -> int | None:
        """Returns the process id of the `roslaunch` that started the node. None if not found on this machine."""
        _, _, uris = _proxy(master).getParam(_CALLER, "/roslaunch/uris")
        for uri in uris.values() if isinstance(uris, dict) else ():
            host, _ = rosgraph.network.parse_http_host_and_port(uri)
            if not rosgraph.network.is_local_address(host):
                continue
            try:
                _, _, (active, _) = _proxy(uri).list_processes()
                # named NAMESPACE/NAME-NUMBER
                if any(f"/{process.rpartition('-')[0]}" == self.name for process, _ in active):
                    return int(_proxy(uri).get_pid()[2])
            except MASTER_FAILURES:  # it was killed, but is still registered
                continue
        return None


def master_of(port: str | None) -> str:
    """Returns the address of the ROS master that `roslaunch` uses.

    Args:
        port: Value of the option `-p` of `roslaunch`. None: the master from the environment.
    """
    return rosgraph.network.create_local_xmlrpc_uri(int(port)) if port else rosgraph.get_master_uri()


def running_simulators(file: str, master: str) -> list[RunningNode]:
    """Returns the running simulators that ROS would stop if a launch file were run, because of equal node names.

    Killed nodes, which stay registered with the master, are not returned.

    Args:
        file: The launch file.
        master: Address of the ROS master.
    """
    publishers, subscribers, services = _state(master)
    registered = {node for _, nodes in (*publishers, *subscribers, *services) for node in nodes}
    if registered <= {"/rosout"}:  # saves reading the file, which may run xacro
        return []
    config = roslaunch.config.load_config_default([file], None, assign_machines=False)
    names = {rosgraph.names.ns_join(node.namespace, node.name) for node in config.nodes if node.package == _PACKAGE}
    return _running(registered & names, master)


def simulator_namespace(nodes: Set[str], master: str) -> str | None:
    """Returns the namespace, such as `left`, of the first simulator among some nodes. None if no simulator runs.

    Args:
        nodes: Full names of the nodes.
        master: Address of the ROS master.
    """
    for service, servers in sorted(_state(master)[2]):
        if service.endswith(f"/{_LIST}") and not nodes.isdisjoint(servers):
            return service.removesuffix(_LIST).strip("/")
    return None


def clocks(master: str) -> list[RunningNode]:
    """Returns the running nodes that publish `/clock` on a master."""
    publishers, _, _ = _state(master)
    return _running({node for topic, nodes in publishers for node in nodes if topic == "/clock"}, master)


def _state(master: str) -> list[list[tuple[str, list[str]]]]:
    """Returns three lists: published topics, subscribed topics, and services, each entry with the names of its nodes.

    If the master does not answer, the lists are empty.
    """
    try:
        return _proxy(master).getSystemState(_CALLER)[2]
    except MASTER_FAILURES:
        return [[], [], []]


def _running(names: Iterable[str], master: str) -> list[RunningNode]:
    """Returns those of the named nodes that answer, sorted by name."""
    nodes = [RunningNode(name, _proxy(master).lookupNode(_CALLER, name)[2]) for name in sorted(names)]
    return [node for node in nodes if node.uri and _answers(node.uri)]


def _proxy(uri: str) -> Any:
    return ServerProxy(uri, TimedTransport(TIMEOUT_S))


def _answers(uri: str) -> bool:
    try:
        _proxy(uri).getPid(_CALLER)
    except MASTER_FAILURES:
        return False
    return True


def _is_running(process: int) -> bool:
    """Returns whether a process exists and is not a zombie; see proc_pid_stat(5)."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
