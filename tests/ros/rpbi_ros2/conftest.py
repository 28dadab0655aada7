"""Common parts of the tests of the bridge: a DDS domain for each test, and ROS 2 programs in it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any
from urllib.parse import urlparse

import pytest
import rospy
from ros2_system import Ros2
from ros_system import RosSystem

FIRST_DOMAIN, FIRST_PORT = 60, 21000
"""Domain for the first port of masters, so that workers on one computer do not meet."""


@pytest.fixture
def domain(ros_master: str) -> int:
    """The worker's domain."""
    return FIRST_DOMAIN + ((urlparse(os.environ["ROS_MASTER_URI"]).port or FIRST_PORT) - FIRST_PORT) % 100


@pytest.fixture
def ros2(ros: RosSystem, domain: int) -> Ros2:
    """Starts programs with ROS 2, which end with the test; without the extra `ros2`, the test is skipped or fails."""
    import_module("cyclonedds")
    return Ros2(ros, domain)


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
