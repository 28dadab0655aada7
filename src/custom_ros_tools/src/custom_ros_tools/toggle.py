"""Something that is switched on and off."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Toggle:
    """Keeps whether something is on, and refuses to switch it to what it is already.

    Args:
        name: What is switched, for the messages.
        start: Called to switch it on.
        stop: Called to switch it off.
    """

    def __init__(self, name: str, start: Callable[[], None], stop: Callable[[], None]) -> None:
        self._name = name
        self._start = start
        self._stop = stop
        self._is_on = False
        self._lock = threading.Lock()

    def on(self) -> tuple[bool, str]:
        """Switches it on; returns whether that changed anything, and a message."""
        return self._switch(True, self._start, "on")

    def off(self) -> tuple[bool, str]:
        """Switches it off; returns whether that changed anything, and a message."""
        return self._switch(False, self._stop, "off")

    def _switch(self, to: bool, act: Callable[[], None], word: str) -> tuple[bool, str]:
        with self._lock:
            if self._is_on == to:
                return False, f"{self._name} is already {word}"
            act()
            self._is_on = to
        return True, f"{self._name} is {word}"
