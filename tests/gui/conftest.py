"""What tests with windows share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from screen import Screen


@pytest.fixture(scope="module")
def screen() -> Iterator[Screen]:
    """A virtual screen."""
    screen = Screen()
    yield screen
    screen.close()
