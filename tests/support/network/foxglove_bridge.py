"""The bridge to Foxglove next to a running world, as the tests of a file share it."""

from __future__ import annotations

import subprocess

import rosgraph
from node_world import Rosout
from ros_system import RosSystem, wait_until
from workplace import Port

NODE = "/foxglove"


class FoxgloveBridge:
    """Starts a bridge, and waits until it serves.

    Args:
        ros: The system to which the bridge belongs.
        is_launched: Whether roslaunch starts it, as users do.

    Attributes:
        ros: The same system.
        process: The node, or roslaunch with it.
        rosout: Messages of all nodes on `/rosout`, from before its start.
    """

    def __init__(self, ros: RosSystem, is_launched: bool = False) -> None:
        self.ros, self._port, self.rosout = ros, Port(), Rosout(ros)
        launch = ["roslaunch", "rpbi_examples", "foxglove.launch", f"port:={self.port}"]
        self.process = ros.start(launch) if is_launched else start_node(ros, self.port)
        wait_until(lambda: "can connect to" in self.output, "the bridge is up")
        self.rosout.wait_to_hear(NODE)

    @property
    def port(self) -> int:
        """Its port on this computer."""
        return self._port.number

    @property
    def output(self) -> str:
        """The lines that it has printed."""
        return self.ros.output(self.process)

    def lines(self, text: str) -> int:
        """Waits for a line on `/rosout` with a text; returns the number of such lines."""
        self.rosout.wait_for([text])
        return len(self.rosout.logs(text))


def start_node(ros: RosSystem, port: int, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
    """Starts the node at a port; with variables of an environment, as a new process instead of a fork."""
    command = ["rosrun", "rpbi_utils", "foxglove_node.py", "--port", str(port), *arguments]
    return ros.start(command, fresh=bool(environment), **environment)


def subscriptions() -> set[str]:
    """Returns the topics to which the bridge subscribes, from the master."""
    return _topics_of(rosgraph.Master("/tests").getSystemState()[1])


def publications() -> set[str]:
    """Returns the topics that the bridge publishes, from the master."""
    return _topics_of(rosgraph.Master("/tests").getSystemState()[0])


def _topics_of(nodes_of: list[tuple[str, list[str]]]) -> set[str]:
    return {topic for topic, nodes in nodes_of if NODE in nodes}
