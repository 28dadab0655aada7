"""Real nodes for tests: starts them, listens to them, calls them and sees to it that none is left."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import cache
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy, Transport

import rosgraph
import roslib.packages
import rosnode
import rospy
import tf2_ros
import yaml
from forked_node import PACKAGES, ForkedNode

from custom_ros_tools.ros.lifecycle.master_watch import MasterWatch
from custom_ros_tools.ros.tf_interface import TfListener
from ros_pybullet_interface.srv import ListObjects

MODULES = os.environ.get("PYTHONPATH")
"""Where all programs find Python modules; those of a test that adds to it, but for `support_on_path`, are no forks."""
READ_LATE = {
    "DISPLAY",
    "HOME",
    "LIBGL_ALWAYS_SOFTWARE",
    "ROS_HOSTNAME",
    "ROS_IP",
    "ROS_MASTER_URI",
    "SPNAV_SOCKET",
    "XDG_RUNTIME_DIR",
}
"""Variables that no module reads when it is imported."""
SUPPORT = Path(__file__).resolve().parents[1]
"""Where the tests' helpers are, in folders by subject; programs that tests start are in `programs`."""
RPBI = str(SUPPORT.parents[1] / "rpbi")
"""The program of the commands; its `launch` is started as roslaunch is."""


def support_on_path(modules: str | None = None) -> dict[str, str]:
    """Returns the environment in which other processes import the tests' helpers.

    Args:
        modules: Where they find other modules; by default where this process's programs do.
    """
    modules = os.environ.get("PYTHONPATH", "") if modules is None else modules
    return {"PYTHONPATH": os.pathsep.join((modules, *map(str, SUPPORT.iterdir())))}


def wait_until(condition: Callable[[], Any], what: str, timeout_s: float = 120.0, every_s: float = 0.05) -> Any:
    """Waits until a condition holds and returns its value.

    Errors of a master that is not up yet count as no, and so does asking for the last of no messages.
    """
    end_s = time.monotonic() + timeout_s
    while True:
        try:
            value = condition()
        except (OSError, IndexError, rosgraph.MasterException, rospy.ROSException):
            value = None
        if value:
            return value
        if time.monotonic() > end_s:
            raise TimeoutError(f"it did not come about within {timeout_s:g} s that {what}")
        time.sleep(every_s)


BARE = ("rostopic", "flood_targets.py", "hold_topics.py", "late_client.py", "ros2_peer.py", "visitor.py")
"""Programs without our handling of Ctrl-C, on which rospy sometimes hangs; they have nothing to finish."""


def stop_group(process: subprocess.Popen, timeout_s: float = 60.0) -> int:
    """Ends a process and its children as Ctrl-C would; returns its exit code.

    Raises:
        TimeoutError: If it did not end by itself.
    """
    if process.poll() is None:
        names = [os.path.basename(word) for word in process.args[:2]] if isinstance(process.args, list) else []
        os.killpg(process.pid, signal.SIGKILL if set(names) & set(BARE) else signal.SIGINT)
    try:
        return process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        raise TimeoutError(f"{process.args} did not end on Ctrl-C") from None


def is_running(process_id: int) -> bool:
    """Tells whether there is such a process, and it has not ended."""
    try:
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


class LimitedTransport(Transport):
    """Gives a node some time to answer; one that hangs counts as one that is not there."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = 20.0
        return connection


def connections_of(topic: str, registered: list[tuple[str, list[str]]]) -> list[list[Any]]:
    """Returns the connections of each living node that is registered for a topic; the killed stay registered."""
    master, found = rosgraph.Master(rospy.get_name()), []
    for node in dict(registered).get(topic, []):
        with contextlib.suppress(ConnectionRefusedError):
            found.append(ServerProxy(master.lookupNode(node), LimitedTransport()).getBusInfo(rospy.get_name())[2])
    return found


def sends_to_us(topic: str, publisher: str | None = None) -> bool:
    """Returns whether a node, or whoever publishes a topic, sends it to us: rospy counts connections not made yet."""
    name = rospy.get_name()
    registered = [(topic, [publisher])] if publisher else rosgraph.Master(name).getSystemState()[0]
    publishers = connections_of(topic, registered)
    return bool(publishers) and all(
        any((to, sent) == (name, topic) for _, to, _, _, sent, *_ in each) for each in publishers
    )


class Listener:
    """Keeps the messages of a topic with the wall time of their arrival [s]."""

    def __init__(self, topic: str, message_type: type) -> None:
        self.messages: list[Any] = []
        self.arrival_s: list[float] = []
        self._subscriber = rospy.Subscriber(topic, message_type, self._on_message, queue_size=10000, tcp_nodelay=True)

    def _on_message(self, message: Any) -> None:
        self.arrival_s.append(time.monotonic())
        self.messages.append(message)

    def wait_for(self, count: int = 1, timeout_s: float = 120.0) -> list[Any]:
        """Waits until so many messages have come and returns all."""
        wait_until(lambda: len(self.messages) >= count, f"{count} messages came on {self.topic}", timeout_s)
        return self.messages

    def wait_for_stamp(self, stamp: rospy.Time) -> Any:
        """Waits until a message with a stamp, or a later one, has come and returns the first such."""

        def found() -> Any:
            return next((each for each in list(self.messages) if each.header.stamp >= stamp), None)

        return wait_until(found, f"{self.topic} has come to {stamp.to_sec():.9f}")

    @property
    def topic(self) -> str:
        """The topic's full name."""
        return self._subscriber.resolved_name

    @property
    def is_connected(self) -> bool:
        """Whether somebody publishes it, and all who do send to us."""
        return sends_to_us(self.topic)

    def hears(self, node: str) -> bool:
        """Whether a node that publishes it sends to us."""
        return sends_to_us(self.topic, node)

    @property
    def stamps_ns(self) -> list[int]:
        """Stamps of the messages' headers [ns]."""
        return [message.header.stamp.to_nsec() for message in self.messages]

    def close(self) -> None:
        """Listens no more."""
        self._subscriber.unregister()


class RosSystem:
    """Nodes of one test, on the tests' own master."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen] = []
        self._listeners: list[Listener] = []
        self._tf_listeners: list[TfListener] = []
        self._lock = threading.Lock()
        if not rospy.core.is_initialized():
            rospy.init_node("tests", anonymous=True, disable_rostime=True, disable_signals=True)
            MasterWatch()  # rospy's own part would leave a subscriber alone now and then, or wait for ever
        rospy.set_param("/use_sim_time", False)
        self._parameters = set(rospy.get_param_names())

    def start(
        self, command: Sequence[str], log: str | None = None, fresh: bool = False, **environment: str
    ) -> subprocess.Popen:
        """Starts a program in a process group of its own; its output goes to `output(process)`.

        Args:
            command: Program and arguments.
            log: Name of the file of its output.
            fresh: Whether our nodes, and those that roslaunch starts, are new processes with all their imports, and
                not forks.
            environment: Variables of its own; with any but those of `READ_LATE`, or another PYTHONPATH than that of
                `support_on_path`, it is fresh too.
        """
        is_launch = command[0] == "roslaunch" or [*command[:2]] == [RPBI, "launch"]
        is_ours = is_launch or command[0] == "rosrun" and command[1] in PACKAGES
        modules = environment.get("PYTHONPATH", os.environ.get("PYTHONPATH"))
        is_known = modules in (MODULES, support_on_path(MODULES)["PYTHONPATH"])
        forks = is_ours and not fresh and is_known and environment.keys() <= {*READ_LATE, "PYTHONPATH"}
        if command[0] == "rosrun":
            command = [find_executable(command[1], command[2]), *command[3:]]
        elif forks:
            command = [str(SUPPORT / "nodes/forked_launch.py"), *command]
        path = self.folder / (log or f"{len(self.processes)}.log")
        everything = {**os.environ, "PYTHONUNBUFFERED": "1", **environment}
        process: subprocess.Popen
        with open(path, "w") as file:
            if forks:
                process = ForkedNode([*command], file.fileno(), file.fileno(), everything)
            else:
                process = subprocess.Popen(
                    command,
                    stdout=file,
                    stderr=subprocess.STDOUT,
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,
                    env=everything,
                )
        process.log_path = path  # type: ignore[attr-defined]
        self.processes.append(process)
        return process

    def start_program(self, name: str, *arguments: str, **environment: str) -> subprocess.Popen:
        """Starts one of the programs in `programs`."""
        command = [sys.executable, str(SUPPORT / "programs" / name), *arguments]
        return self.start(command, **{**environment, **support_on_path(environment.get("PYTHONPATH"))})

    def output(self, process: subprocess.Popen) -> str:
        """Returns what a program has printed so far."""
        return process.log_path.read_text(errors="replace")  # type: ignore[attr-defined]

    def simulator(
        self,
        world: dict[str, Any],
        use_sim_time: bool = False,
        wait: bool = True,
        namespace: str = "/",
        fresh: bool = False,
        **environment: str,
    ) -> subprocess.Popen:
        """Starts the simulator node with a main configuration and waits until it is up; see also `start`."""
        rospy.set_param("/use_sim_time", use_sim_time)
        name = f"{namespace}ros_pybullet_interface"
        rospy.set_param(f"{name}/config", world)
        service = f"{namespace}rpbi/list_objects"
        before = _provider(service)  # one that was killed is still registered
        command = ["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py", f"__ns:={namespace}"]
        process = self.start(command, fresh=fresh, **environment)
        if wait:
            wait_until(
                lambda: process.poll() is not None or _provider(service) not in (None, before),
                "the node serves",
            )
            assert process.poll() is None, self.output(process)
            self.call(service, ListObjects)  # its loop answers, and runs when all topics and services are there
        return process

    def listen(self, topic: str, message_type: type) -> Listener:
        """Listens to a topic until the test ends."""
        listener = Listener(topic, message_type)
        self._listeners.append(listener)
        return listener

    def listen_to_tf(self) -> tf2_ros.Buffer:
        """Returns a buffer that TF comes into until the test ends."""
        buffer = tf2_ros.Buffer(debug=False)
        self._tf_listeners.append(TfListener(buffer))
        return buffer

    def call(self, service: str, service_type: type, *arguments: Any, **fields: Any) -> Any:
        """Calls a service."""
        rospy.wait_for_service(service, timeout=120.0)
        return rospy.ServiceProxy(service, service_type)(*arguments, **fields)

    def write_yaml(self, name: str, data: dict[str, Any]) -> str:
        """Writes a YAML file into the test's folder and returns its path."""
        path = self.folder / name
        path.write_text(yaml.safe_dump(data))
        return str(path)

    def close(self) -> None:
        """Ends all that was started; a program that does not end by itself fails the test."""
        for listener in self._listeners:
            listener.close()
        for tf_listener in self._tf_listeners:
            tf_listener.unregister()
        late = []
        for process in reversed(self.processes):
            is_of_a_test = process.args[:2] == [sys.executable, "-c"]  # a few lines with rospy by itself, as in BARE
            if is_of_a_test and process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            try:
                stop_group(process)
            except TimeoutError as error:
                late.append(f"{error}:\n{self.output(process)}")
            if "] escalating to SIGTERM" in self.output(process):
                late.append(f"roslaunch had to end a node by force:\n{self.output(process)}")
        rospy.set_param("/use_sim_time", False)
        for name in set(rospy.get_param_names()) - self._parameters:  # launch files leave theirs behind
            rospy.delete_param(name)
        if any(process.returncode == -signal.SIGKILL for process in self.processes):
            forget_dead_nodes()
        if late:
            raise AssertionError("\n".join(late))


@cache
def find_executable(package: str, name: str) -> str:
    """Returns the path of what `rosrun` would run, without the processes by which `rosrun` finds it."""
    return str(roslib.packages.find_node(package, name)[0])


def forget_dead_nodes() -> None:
    """Takes from the master what nodes have there that were killed; later tests would wait for them, or find them."""
    master = rosgraph.Master("/tests")
    for node in {node for kind in master.getSystemState() for _, nodes in kind for node in nodes}:
        try:
            ServerProxy(master.lookupNode(node), LimitedTransport()).getPid("/tests")
        except ConnectionRefusedError:
            rosnode.cleanup_master_blacklist(master, [node])
        except (OSError, rosgraph.MasterException):  # it hangs, or has just ended
            continue


def _provider(service: str) -> str | None:
    """Returns where a service is served, None if nowhere."""
    try:
        return str(rosgraph.Master("/tests").lookupService(service))
    except rosgraph.MasterError:
        return None
