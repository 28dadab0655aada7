"""A function that is switched on and off."""

import threading
from collections.abc import Callable


class Toggle:
    """Stores whether a function is on; refuses to switch it to its present state.

    `start` switches it on and `stop` off; `name` is its name in messages.
    """

    def __init__(self, name: str, start: Callable[[], None], stop: Callable[[], None]) -> None:
        self._name, self._start, self._stop = name, start, stop
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
