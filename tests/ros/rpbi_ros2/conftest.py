"""Common parts of the tests of the bridge: a DDS domain for each worker, and ROS 2 programs in it."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any
from urllib.parse import urlparse

import pytest
import rospy
from ros2_system import Ros2, Ros2Peer
from ros_system import RosSystem

FIRST_DOMAIN, FIRST_PORT = 60, 21000
"""Domain for the first port of masters, so that workers on one computer do not meet."""


@pytest.fixture(scope="session")
def domain(ros_master: str) -> int:
    """The worker's domain; without the extra `ros2`, the test is skipped or fails."""
    import_module("cyclonedds")
    return FIRST_DOMAIN + ((urlparse(os.environ["ROS_MASTER_URI"]).port or FIRST_PORT) - FIRST_PORT) % 100


@pytest.fixture
def ros2(ros: RosSystem, domain: int) -> Ros2:
    """Starts programs with ROS 2, which end with the test."""
    return Ros2(ros, domain)


@pytest.fixture(scope="module")
def module_ros2(module_ros: RosSystem, domain: int) -> Ros2:
    """Starts programs with ROS 2, which all tests of a module use; each test has topics of its own."""
    return Ros2(module_ros, domain)


@pytest.fixture(scope="module")
def bridge(module_ros2: Ros2) -> subprocess.Popen[bytes]:
    """The bridge of a module's tests."""
    return module_ros2.bridge()


@pytest.fixture(scope="module")
def peer(module_ros2: Ros2, bridge: subprocess.Popen[bytes]) -> Ros2Peer:
    """The node with rclpy of a module's tests, with the bridge in its domain."""
    return module_ros2.peer()


@pytest.fixture
def publisher(ros: RosSystem) -> Iterator[Callable[..., rospy.Publisher]]:
    """Makes publishers of ROS 1 that end with the test."""
    made = []

    def publish(topic: str, message_class: Any, **options: Any) -> rospy.Publisher:
        made.append(rospy.Publisher(topic, message_class, **{"queue_size": 1000, **options}))
        return made[-1]

    yield publish
    for each in made:
        each.unregister()
