"""What tests of PyBullet's window share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pybullet_window import open_window
from screen import Screen


@pytest.fixture(scope="module")
def module_ros(ros_master: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Nodes that all tests of a module use; each test leaves them as it found them."""
    from ros_system import RosSystem

    system = RosSystem(tmp_path_factory.mktemp("module"))
    try:
        yield system
    finally:
        system.close()


@pytest.fixture
def start(ros: Any, screen: Screen) -> Any:
    """Starts a simulator with a window and waits until that is there; returns its process."""
    return lambda **main: open_window(ros, screen, **main)
