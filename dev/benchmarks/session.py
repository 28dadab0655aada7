"""A private ROS master, and the nodes and programs of one benchmark around it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import arrivals
import rosgraph

from custom_ros_tools.ros.lifecycle.timed_master import unused_port

PROGRAMS = Path(__file__).parent / "programs"
JOINT_STATES = "/rpbi/kuka_lwr/joint_states"
COLOUR, DEPTH = "/rpbi/camera/colour/image", "/rpbi/camera/depth/image"
CLOUD = "/rpbi/camera/pointcloud"
TYPES = {"joint_states": "sensor_msgs/JointState", "image": "sensor_msgs/Image", "clock": "rosgraph_msgs/Clock"}
TYPES |= {"pointcloud": "sensor_msgs/PointCloud2"}
TYPES |= {"diagnostics": "diagnostic_msgs/DiagnosticArray", "tf": "tf2_msgs/TFMessage"}
TYPES |= {"segments": "geometry_msgs/PoseArray"}
START_TIMEOUT_S = 60.0
MAX_SHOWN = 4000
"""Most characters of the output of a failed program that are shown."""
CAMERA_POSE = "-0.32 -2.05 2.2 -0.346 0 -2.22".split()  # x y z [m], yaw pitch roll [rad]: the example's view


class Session:
    """Starts all processes of a benchmark with its own master, and ends all of them.

    Args:
        use_sim_time: Whether ROS time is the simulator's.

    Attributes:
        folder: A temporary folder.
        environment: Variables of everything that it starts.
    """

    def __init__(self, use_sim_time: bool = True) -> None:
        self._use_sim_time = use_sim_time
        self._processes: list[subprocess.Popen[bytes]] = []
        self._folder = tempfile.TemporaryDirectory(prefix="rpbi-bench-")
        self.folder = Path(self._folder.name)
        port = unused_port()
        uri = f"http://127.0.0.1:{port}"
        self.environment = {
            **{key: value for key, value in os.environ.items() if key not in ("ROS_HOSTNAME", "ROS_NAMESPACE")},
            "ROS_MASTER_URI": uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(self.folder / "ros"),
        }
        self._master = rosgraph.Master("/benchmarks", master_uri=uri)
        self._port = port

    def __enter__(self) -> Session:
        try:
            self.start(["roscore", "-p", str(self._port)])
            self._until(lambda: self._master.lookupNode("/rosout"), "the ROS master is up")
            self._master.setParam("/use_sim_time", self._use_sim_time)
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def start(self, command: list[str], **environment: str) -> subprocess.Popen[bytes]:
        """Starts a command in its own process group; its output goes to a file (see `output`).

        Args:
            command: The command.
            environment: Environment variables in addition to those of the session.
        """
        with open(self.folder / f"{len(self._processes)}.log", "wb") as file:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env={**self.environment, **environment},
            )
        self._processes.append(process)
        return process

    def program(self, name: str, *arguments: Any, **environment: str) -> subprocess.Popen[bytes]:
        """Starts one of `programs/`, with further variables of its environment."""
        return self.start([sys.executable, "-u", str(PROGRAMS / f"{name}.py"), *map(str, arguments)], **environment)

    def set_parameters(self, name: str, values: dict[str, Any]) -> None:
        """Sets the parameters below a name."""
        self._master.setParam(name, values)

    def simulator(self, world: dict[str, Any]) -> subprocess.Popen[bytes]:
        """Starts the simulator with a main configuration and waits until it is up."""
        self._master.setParam("/ros_pybullet_interface/config", world)
        return self.node(["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py"], "/rpbi/list_objects")

    def node(self, command: list[str], service: str) -> subprocess.Popen[bytes]:
        """Starts a node and waits until it offers a service.

        Raises:
            RuntimeError: If it does not; with its output.
        """
        process = self.start(command)
        self._until(lambda: self._master.lookupService(service), f"there is {service}", process)
        return process

    def place_camera(self) -> None:
        """Moves the camera to where it sees arm and floor."""
        self.start(["rosrun", "tf2_ros", "static_transform_publisher", *CAMERA_POSE, "rpbi/world", "rpbi/camera"])

    def watch(
        self,
        *topics: str,
        seconds: float = 3600.0,
        stock: bool = True,
        spent_by: subprocess.Popen[bytes] | None = None,
    ) -> Watcher:
        """Starts a subscriber in its own process and waits until it has received from every topic.

        Args:
            topics: What it subscribes to.
            seconds: Time for which it then continues [s].
            stock: Whether it is an ordinary node, which takes /clock too where that is the time.
            spent_by: A process; the processor time of its main thread is noted with each message.
        """
        path = self.folder / f"{len(self._processes)}.npz"
        typed = [f"{topic}:{TYPES[topic.rsplit('/', 1)[-1]]}" for topic in topics]
        options = [*([] if stock else ["--wall"]), *([] if spent_by is None else ["--process", spent_by.pid])]
        process = self.program("watch", path, seconds, *options, *typed)
        self._until(lambda: "ready" in self.output(process), f"messages come on {', '.join(topics)}", process)
        return Watcher(self, process, path)

    def output(self, process: subprocess.Popen[bytes]) -> str:
        """Returns what a process has printed so far."""
        return self.output_file(process).read_text(errors="replace")

    def output_file(self, process: subprocess.Popen[bytes]) -> Path:
        """Returns the file with the output of a process."""
        return self.folder / f"{self._processes.index(process)}.log"

    def wait_for_output(self, process: subprocess.Popen[bytes], text: str) -> None:
        """Waits until a process has printed a text.

        Raises:
            RuntimeError: If it does not; with its output.
        """
        self._until(lambda: text in self.output(process), f"it printed '{text}'", process)

    def result_of(self, process: subprocess.Popen[bytes], timeout_s: float = 600.0) -> Any:
        """Waits for one of `programs/` to end and returns the JSON that it prints after `result: `.

        Raises:
            RuntimeError: If it fails.
        """
        if process.wait(timeout_s):
            raise RuntimeError(f"{process.args} failed:\n{self.output(process)[-MAX_SHOWN:]}")
        # PyBullet prints a lot around it
        found = [line for line in self.output(process).splitlines() if line.startswith("result: ")]
        return json.loads(found[-1].partition(": ")[2]) if found else None

    def stop(self, process: subprocess.Popen[bytes]) -> None:
        """Ends a process and its children as Ctrl-C would, and by SIGKILL if that has no effect."""
        for number, timeout_s in ((signal.SIGINT, 60.0), (signal.SIGKILL, 5.0)):
            if process.poll() is not None:
                return
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(process.pid, number)
                os.killpg(process.pid, signal.SIGCONT)
                process.wait(timeout_s)

    def close(self) -> None:
        """Ends all that was started, the master last."""
        for process in reversed(self._processes):
            self.stop(process)
        self._folder.cleanup()

    def _until(self, condition: Callable[[], Any], what: str, process: subprocess.Popen[bytes] | None = None) -> None:
        end_s = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < end_s and (process is None or process.poll() is None):
            try:
                if condition():
                    return
            except (OSError, rosgraph.MasterException):
                pass
            time.sleep(0.05)
        printed = "" if process is None else f":\n{self.output(process)}"
        raise RuntimeError(f"it did not come about that {what}{printed}")


class Watcher:
    """A subscriber in another process.

    Attributes:
        process: The process.
    """

    def __init__(self, session: Session, process: subprocess.Popen[bytes], path: Path) -> None:
        self.process = process
        self._session, self._path = session, path

    def arrivals(self) -> dict[str, arrivals.Arrivals]:
        """Waits until its time is over and returns the received messages, by topic."""
        self._session.result_of(self.process)
        return arrivals.load(self._path)
