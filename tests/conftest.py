"""What all tests share: the workspace on the path, and a private ROS master on a free port."""

from __future__ import annotations

import ctypes
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


# rospy reads these when it is imported, so they must stand before any test module is.
_HOME = tempfile.TemporaryDirectory(prefix="rpbi-tests-")
os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{_free_port()}"
os.environ["ROS_IP"] = "127.0.0.1"
os.environ["ROS_HOME"] = _HOME.name
os.environ.pop("ROS_HOSTNAME", None)
os.environ.pop("ROS_NAMESPACE", None)


def pytest_terminal_summary() -> None:
    """Empties the buffer of what PyBullet printed, so that pytest's closing line comes last."""
    ctypes.CDLL(None).fflush(None)


@pytest.fixture(scope="session")
def ros_master() -> Iterator[str]:
    """A ROS master of our own; its URI. It ends with the tests."""
    uri = os.environ["ROS_MASTER_URI"]
    log = open(Path(_HOME.name) / "roscore.log", "w")
    roscore = subprocess.Popen(
        ["roscore", "-p", uri.rsplit(":", 1)[1]], stdout=log, stderr=subprocess.STDOUT, start_new_session=True
    )
    import rosgraph
    from ros_system import stop_group, wait_until

    wait_until(rosgraph.is_master_online, "the ROS master answers", 30.0)
    wait_until(lambda: rosgraph.Master("/tests").lookupNode("/rosout"), "rosout is up", 30.0)
    yield uri
    stop_group(roscore)
    log.close()


@pytest.fixture
def ros(ros_master: str, tmp_path: Path) -> Iterator[RosSystem]:  # noqa: F821
    """Starts nodes, talks to them and stops them after the test."""
    from ros_system import RosSystem

    system = RosSystem(tmp_path)
    try:
        yield system
    finally:
        system.close()


@pytest.fixture(scope="module")
def module_ros(ros_master: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RosSystem]:  # noqa: F821
    """Nodes that all tests of a module use; each test leaves them as it found them."""
    from ros_system import RosSystem

    system = RosSystem(tmp_path_factory.mktemp("module"))
    try:
        yield system
    finally:
        system.close()


@pytest.fixture
def second_master(ros: RosSystem) -> SecondMaster:  # noqa: F821
    """A master that may be killed; the tests' own one goes on."""
    from second_master import SecondMaster

    return SecondMaster(ros)
