"""Nodes in Python that start without their imports: forked from a process that has done these already.

A node imports for 0.3 to 0.7 s before its first own line, and tests start several hundred. The process that they are
forked from has one thread, no ROS node and no window; each fork runs the program from its first line as `__main__`,
with the arguments, environment and streams that it would have had, and becomes a child of the tests' process.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import json
import os
import re
import runpy
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

PROGRAMS = Path(__file__).resolve().parents[3] / "devel/lib"
PACKAGES = {
    "custom_ros_tools",
    "ik_ros",
    "keyboard",
    "motion_primitives",
    "operator_node",
    "rpbi_mpc",
    "rpbi_planning",
    "ros_pybullet_interface",
    "rpbi_data",
    "rpbi_examples",
    "rpbi_ros2",
    "rpbi_utils",
    "episodes",
    "safe_robot",
    "teleop",
}
"""ROS packages whose programs may be forked: Python scripts that run a function by `custom_ros_tools.program`."""
PRELOADED = (
    "custom_ros_tools/attach_marker",
    "custom_ros_tools/remap_joint_state_to_joint_state",
    "ik_ros/ik_setup_node.py",
    "ik_ros/ik_solver_node.py",
    "operator_node/device_node.py",
    "operator_node/mapping_node.py",
    "ros_pybullet_interface/ros_pybullet_interface_node.py",
    "rpbi_examples/figure_eight_node.py",
    "rpbi_examples/ik_example_node.py",
    "rpbi_utils/interpolation_node.py",
    "rpbi_utils/stand_in_node.py",
    "safe_robot/safe_robot_node.py",
)
"""Programs whose modules are imported before; those of others are when they run."""
NOT_PRELOADED = ("cv2", "matplotlib", "OpenGL", "pygame", "tkinter")
"""Modules that keep windows, screens or threads, which a fork may not share."""
PR_SET_CHILD_SUBREAPER = 36
MAX_REQUEST = 1 << 20


class ForkedNode(subprocess.Popen):
    """A Python script in a session of its own, without standard input.

    The go-between that forks it ends at once, so that it becomes a child of this process, which can wait for it.

    Args:
        command: Path of the script, and its arguments.
        output: File handle that its standard output goes to.
        errors: File handle that its standard errors go to.
        environment: All of its environment variables.
        folder: Its working directory; by default that of this process.
    """

    def __init__(
        self, command: list[str], output: int, errors: int, environment: dict[str, str], folder: str | None = None
    ) -> None:
        self.args, self.returncode = command, None
        self.stdin = self.stdout = self.stderr = None
        self._waitpid_lock = threading.Lock()
        if not _servers:
            _servers.append(_program_server())
        request = json.dumps([command, environment, folder or os.getcwd()]).encode()
        self.pid = _servers[0].fork(request, [output, errors])
        self._child_created = True


class _Server:
    """The process that nodes are forked from; it ends when the other end of its channel is closed."""

    def __init__(self, channel: socket.socket, wait: Callable[[], object]) -> None:
        self._channel, self._wait = channel, wait

    def fork(self, request: bytes, outputs: list[int]) -> int:
        """Starts a script and returns its process id."""
        _adopt_orphans(True)
        try:
            socket.send_fds(self._channel, [request], outputs)
            answer = self._channel.recv(32)
        finally:
            _adopt_orphans(False)
        if not answer:
            raise ChildProcessError(f"{__file__} has ended, with {self._wait()}")
        return int(answer)

    def close(self) -> None:
        """Ends it."""
        self._channel.close()
        self._wait()


_servers: list[_Server] = []


def _program_server() -> _Server:
    """Starts this file as a program."""
    ours, theirs = _channel()
    command = [sys.executable, __file__, str(theirs.fileno())]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        command, pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, env=environment, start_new_session=True
    )
    theirs.close()
    return _Server(ours, process.wait)


def split_server() -> list[str] | None:
    """Makes a fork of this process the one that this process's nodes are forked from.

    This process must have one thread. In each of the nodes, the call returns the command that it is to run, for
    `run_script`.
    """
    ours, theirs = _channel()
    pid = os.fork()
    if pid:
        theirs.close()
        _servers[:] = [_Server(ours, partial(os.waitpid, pid, 0))]
        return None
    ours.close()
    os.setsid()
    return _serve(theirs)


def close_server() -> None:
    """Ends the process that nodes are forked from, if there is one."""
    while _servers:
        _servers.pop().close()


def _channel() -> tuple[socket.socket, socket.socket]:
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setblocking(True)  # whatever the default is just now
    return ends


def _adopt_orphans(adopts: bool) -> None:
    """Has processes whose parents end become children of this process, or no more."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, int(adopts), 0, 0, 0)


def _serve(channel: socket.socket) -> list[str]:
    """Forks for each request until the tests end; returns in each fork, with the command that it is to run."""
    while True:
        request, (*outputs,), _, _ = socket.recv_fds(channel, MAX_REQUEST, 2)
        if not request:
            sys.exit()
        command, environment, folder = json.loads(request)
        ready, report = os.pipe()
        between = os.fork()
        if not between:
            between = os.getpid()
            if os.fork():
                os._exit(0)
            while os.getppid() == between:  # a node that roslaunch starts watches its parent
                time.sleep(0.001)
            os.setsid()
            os.dup2(outputs[0], 1)
            os.dup2(outputs[1], 2)
            os.chdir(folder)
            os.environ.clear()
            os.environ.update(environment)
            os.write(report, str(os.getpid()).encode())
            _close(*outputs, ready, report, channel.detach())
            return command
        os.waitpid(between, 0)
        pid = os.read(ready, 32)
        _close(*outputs, ready, report)
        channel.send(pid)


def _close(*handles: int) -> None:
    for handle in handles:
        os.close(handle)


def run_script(command: list[str]) -> None:
    """Runs a script with its arguments as if Python had just been started with it."""
    sys.argv[:] = command
    sys.path[0] = os.path.dirname(command[0])
    sys.path[1:1] = [each for each in os.environ["PYTHONPATH"].split(os.pathsep) if each and each not in sys.path]
    importlib.reload(sys.modules["rospy.names"])  # it takes namespace and remappings from argv when it is imported
    runpy.run_path(command[0], run_name="__main__")


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for program in PRELOADED:
        (module,) = re.findall(r'run\("([\w.]+):', (PROGRAMS / program).read_text())
        importlib.import_module(module)
    importlib.import_module("roslaunch")  # of forked_launch.py
    assert len(os.listdir("/proc/self/task")) == 1 and not set(NOT_PRELOADED) & set(sys.modules)
    gc.freeze()
    run_script(_serve(socket.socket(fileno=int(sys.argv[1]))))
