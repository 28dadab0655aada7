"""What tests of the simulator node share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def module_ros(ros_master: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Nodes that all tests of a module use; each test leaves them as it found them."""
    from ros_system import RosSystem

    system = RosSystem(tmp_path_factory.mktemp("module"))
    try:
        yield system
    finally:
        system.close()
