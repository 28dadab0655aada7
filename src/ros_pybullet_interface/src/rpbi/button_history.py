"""What happened to keys and mouse buttons, one thing at a time."""

from __future__ import annotations

import pybullet

DOWN: int = pybullet.KEY_IS_DOWN
TRIGGERED: int = pybullet.KEY_WAS_TRIGGERED
RELEASED: int = pybullet.KEY_WAS_RELEASED
PRESSED = DOWN | TRIGGERED


class ButtonHistory:
    """Takes apart what PyBullet tells in one number, which may hold a press and a release.

    What happens to a button between two frames of the window reaches us as the last of it: a short tap as a release, a
    release and a new press as a press. Both are told apart here by what was known before, so that presses and releases
    always alternate, and none is told twice.
    """

    def __init__(self) -> None:
        self._held: set[int] = set()

    def take(self, button: int, state: int) -> list[int]:
        """Returns what has happened to a button since the last time, in order.

        Args:
            button: Its code.
            state: Sum of DOWN, TRIGGERED and RELEASED.

        Returns:
            PRESSED, DOWN (held) or RELEASED each.
        """
        was_held, is_held = button in self._held, bool(state & DOWN)
        (self._held.add if is_held else self._held.discard)(button)
        if state & TRIGGERED:
            happened = [RELEASED, PRESSED] if was_held else [PRESSED]
            if state & RELEASED and not (was_held and is_held):
                happened += [RELEASED, PRESSED] if is_held else [RELEASED]
            return happened
        if state & RELEASED:
            return [RELEASED] if was_held else [PRESSED, RELEASED]
        return [DOWN] if is_held else []
