"""What tests with windows share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from screen import Screen


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Screen]:
    """A virtual screen, with a home for what RViz reads and writes there."""
    screen = Screen()
    home = str(tmp_path_factory.mktemp("home"))
    screen.environment.update(HOME=home, XDG_RUNTIME_DIR=home)
    yield screen
    screen.close()
