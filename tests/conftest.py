"""What all tests share: a workplace for each worker, a ROS master in it, and how a run is planned and reported."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from workplace import Workplace

WORKPLACE = Workplace()

import rosgraph  # noqa: E402
import rospy  # noqa: E402
from careful_master import path_with  # noqa: E402
from forked_node import close_server  # noqa: E402
from ros_system import RosSystem, stop_group, wait_until  # noqa: E402
from second_master import SecondMaster  # noqa: E402

from custom_ros_tools import plugins  # noqa: E402
from custom_ros_tools.ros.tf_interface import TfInterface  # noqa: E402

pytest_plugins = ("work_plan", "run_report", "second_try")
os.environ["PATH"] = path_with(WORKPLACE.folder / "bin")


def pytest_collection_finish() -> None:
    """Exempts the collected tests and imported modules from garbage collection, which takes time in every test."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary() -> None:
    """Empties the buffer of what PyBullet printed, so that pytest's closing line comes last."""
    ctypes.CDLL(None).fflush(None)


@pytest.fixture(scope="session", autouse=True)
def no_process_is_left() -> Iterator[None]:
    """Fails the last test of a worker if any of its tests left a process behind, and ends that process."""
    yield
    close_server()
    with contextlib.suppress(TimeoutError):  # whoever was told to end may need a moment
        wait_until(lambda: not WORKPLACE.processes(), "all processes have ended", 15.0)
    left = WORKPLACE.processes()
    for process_id in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process_id, signal.SIGKILL)
    assert not left, f"tests left processes behind: {left}"


@pytest.fixture(autouse=True)
def any_package_is_trusted_again() -> Iterator[None]:
    """Ends what a command that ran in this process allowed to be imported: the next test is another program."""
    yield
    plugins._trust = None


@pytest.fixture(scope="module", autouse=True)
def memory_is_given_back() -> Iterator[None]:
    """Has the C library give back what a module's worlds left free: it would keep 40 MB and more for each file."""
    yield
    ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session")
def ros_master(no_process_is_left: None) -> Iterator[str]:
    """A ROS master of our own; its URI. It ends with the tests."""
    port = WORKPLACE.port
    log_path = WORKPLACE.folder / "roscore.log"
    with open(log_path, "w") as log:
        command = ["roscore", "-p", str(port.number)]
        roscore = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
    try:
        wait_until(rosgraph.is_master_online, "the ROS master answers", 60.0)
        wait_until(lambda: rosgraph.Master("/tests").lookupNode("/rosout"), "rosout is up", 60.0)
    except TimeoutError as error:
        raise TimeoutError(f"{error}:\n{log_path.read_text()}") from None
    yield port.uri
    rospy.signal_shutdown("the tests are over")  # else this process would say that it misses its master
    stop_group(roscore)


@pytest.fixture
def ros(ros_master: str, tmp_path: Path) -> Iterator[RosSystem]:
    """Starts nodes, talks to them and stops them after the test."""
    system = RosSystem(tmp_path)
    try:
        yield system
    finally:
        system.close()


@pytest.fixture(scope="module")
def module_ros(ros_master: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RosSystem]:
    """Nodes that all tests of a module use; each test leaves them as it found them."""
    system = RosSystem(tmp_path_factory.mktemp("module"))
    try:
        yield system
    finally:
        system.close()


@pytest.fixture
def file_limit(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], None]]:
    """Limits the size of files that this process and new ones write, and lifts the limit at the end."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python would keep what it could write of a module
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.fixture
def own_tf(ros: RosSystem) -> Iterator[TfInterface]:
    """TF of the tests' own process; what it left open on /tf would be there for all tests to come."""
    interface = TfInterface()
    yield interface
    interface._listener.unregister()
    interface.tf_broadcaster.pub_tf.unregister()


@pytest.fixture
def second_master(ros: RosSystem) -> SecondMaster:
    """A master that may be killed; the tests' own one goes on."""
    return SecondMaster(ros)
