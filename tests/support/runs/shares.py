"""Plugin for pytest: what runs in real time gets the processor first, and few whole examples run at once.

Tests that only compute have a lower priority, and fill the time in which others wait. An example has many nodes; with
three of them at once on two processors, simulators would starve each other.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Generator
from pathlib import Path
from typing import IO

import pytest

TESTS = Path(__file__).resolve().parents[2]
EXAMPLES = ("ros/rpbi_examples", "gui/rpbi_examples", "gui/rpbi", "ros/ik_ros/test_ik_example.py")
"""Folders and files whose tests start whole examples."""
COMPUTING = ("unit", "sim")
"""Folders whose tests need no real time."""
FOLDER = TESTS.parent / ".rpbi/test-slots"
NICENESS = 10
POLL_S = 0.1


def is_in(path: Path, places: tuple[str, ...]) -> bool:
    """Returns whether a file is in one of some folders of tests, or is one of these files."""
    return any(path.is_relative_to(TESTS / place) for place in places)


class Slots:
    """As many slots as processors for all runs in this workspace; a process has one of them at most."""

    def __init__(self) -> None:
        self._file: IO[str] | None = None

    def acquire(self) -> None:
        """Waits for a slot, unless this process has one."""
        FOLDER.mkdir(parents=True, exist_ok=True)
        while self._file is None:
            for index in range(os.cpu_count() or 1):
                file = open(FOLDER / str(index), "w")
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    file.close()
                    continue
                self._file = file
                return
            time.sleep(POLL_S)

    def release(self) -> None:
        """Gives the slot back, if there is one."""
        if self._file is not None:
            fcntl.flock(self._file, fcntl.LOCK_UN)  # closing would not do if a fork has the file too
            self._file.close()
            self._file = None


_slots = Slots()
_can_renice = os.geteuid() == 0


@pytest.hookimpl(hookwrapper=True, tryfirst=True)  # before the time of the test counts
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, None, None]:
    """Waits for a slot before the first test of an example, and sets the priority of this worker."""
    is_example = is_in(item.path, EXAMPLES)
    if is_example:
        _slots.acquire()
    if _can_renice:
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS if is_in(item.path, COMPUTING) else 0)
    yield
    if is_example and (nextitem is None or nextitem.path != item.path):
        _slots.release()
