"""The keys that are held, and their events."""

import math
import time
from collections.abc import Set
from typing import NamedTuple

from operator_node.key_axes import KEY_CODES

MODIFIERS = {
    KEY_CODES["LSHIFT"]: 1,
    KEY_CODES["RSHIFT"]: 2,
    KEY_CODES["LCTRL"]: 64,
    KEY_CODES["RCTRL"]: 128,
    KEY_CODES["LALT"]: 256,
    KEY_CODES["RALT"]: 512,
    KEY_CODES["LMETA"]: 1024,
    KEY_CODES["RMETA"]: 2048,
    KEY_CODES["MODE"]: 16384,
}
"""Bit of each modifier by the code of its key, see `keyboard/Key`."""
NUM_LOCK, CAPS_LOCK = 4096, 8192
"""Bits of the locks, modifiers that stay on without being held."""


class KeyEvent(NamedTuple):
    """A key that went down or up.

    Attributes:
        code: Its code, see `KEY_CODES`.
        modifiers: Sum of the bits of the modifiers that were held or locked.
        is_down: Whether it went down.
    """

    code: int
    modifiers: int
    is_down: bool


class HeldKeys:
    """Tracks the keys that are held, and repeats the last one that went down.

    Args:
        repeats: Whether keys repeat.
        delay_s: Time for which a key is held before it repeats [s].
        interval_s: Period of the repetition [s].
    """

    def __init__(self, repeats: bool, delay_s: float, interval_s: float) -> None:
        self._repeats, self._delay_s, self._interval_s = repeats, delay_s, interval_s
        self._held: dict[int, None] = {}
        self._events: list[KeyEvent] = []
        self._repeating = 0
        self._repeat_at_s = math.inf

    @property
    def codes(self) -> Set[int]:
        """Codes of the keys that are held, the oldest first."""
        return self._held.keys()

    @property
    def repeat_at_s(self) -> float:
        """Time of the next repetition, by `time.monotonic`; infinity if none is due."""
        return self._repeat_at_s

    def press(self, code: int, locks: int = 0) -> None:
        """Records that a key went down; ignores a key that is held already."""
        if code in self._held:
            return
        self._events.append(KeyEvent(code, self._modifiers(locks), True))
        self._held[code] = None
        if self._repeats and code not in MODIFIERS:
            self._repeating, self._repeat_at_s = code, time.monotonic() + self._delay_s

    def release(self, code: int, locks: int = 0) -> None:
        """Records that a key went up; ignores a key that is not held."""
        if code not in self._held:
            return
        del self._held[code]
        self._events.append(KeyEvent(code, self._modifiers(locks), False))
        if code == self._repeating:
            self._repeat_at_s = math.inf

    def release_all(self) -> None:
        """Records that all keys went up, the last one first."""
        for code in [*reversed(self._held)]:
            self.release(code)

    def drain_events(self) -> tuple[KeyEvent, ...]:
        """Returns and clears the events since the last call, with the repetition if one is due."""
        now_s = time.monotonic()
        if now_s >= self._repeat_at_s:
            self._events.append(KeyEvent(self._repeating, self._modifiers(0), True))
            self._repeat_at_s = now_s + self._interval_s
        events, self._events = tuple(self._events), []
        return events

    def _modifiers(self, locks: int) -> int:
        return locks + sum(MODIFIERS.get(code, 0) for code in self._held)
