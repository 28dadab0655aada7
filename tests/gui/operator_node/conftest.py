"""What tests with windows of this process share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from screen import Screen


@pytest.fixture(scope="session")
def screen(no_process_is_left: None) -> Iterator[Screen]:
    """A virtual screen for all files: Tk stays connected to it, and ends the process when it goes."""
    screen = Screen()
    yield screen
    screen.close()
