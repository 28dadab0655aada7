"""What tests of PyBullet's window share."""

from __future__ import annotations

from typing import Any

import pytest
from pybullet_window import open_window
from screen import Screen


@pytest.fixture
def start(ros: Any, screen: Screen) -> Any:
    """Starts a simulator with a window and waits until that is there; returns its process."""
    return lambda **main: open_window(ros, screen, **main)
