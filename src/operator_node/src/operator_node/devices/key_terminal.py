"""Reads the keyboard through a terminal, which reports when a key goes down but not when the key goes up."""

import contextlib
import os
import select
import sys
import termios
import time
import tty

from operator_node.device import DeviceError

from .key_window import CODES
from .keys import KEY_CODES, HeldKeys

ESCAPE = "\x1b"
SEQUENCES = {
    **{
        f"{start}{end}": name
        for start in ("[", "O")
        for end, name in zip("ABCDHF", ("UP", "DOWN", "RIGHT", "LEFT", "HOME", "END"))
    },
    "[1~": "HOME",
    "[2~": "INSERT",
    "[3~": "DELETE",
    "[4~": "END",
    "[5~": "PAGEUP",
    "[6~": "PAGEDOWN",
    **{f"O{end}": f"F{number}" for number, end in enumerate("PQRS", 1)},
    **{f"[{code}~": f"F{number}" for number, code in enumerate((15, 17, 18, 19, 20, 21, 23, 24), 5)},
}
"""Maps the characters after an escape character, as xterm and VT100 send them, to the name of the key."""
CONTROLS = {"\x7f": "BACKSPACE", "\b": "BACKSPACE", "\t": "TAB", "\r": "RETURN", "\n": "RETURN", ESCAPE: "ESCAPE"}
MAX_BYTES = 4096


def codes_in(text: str) -> list[int]:
    """Returns the code of each key in the text that a terminal sent; 0 for a key without a code."""
    codes = []
    while text:
        length = next((n for n in (4, 3, 2) if text[0] == ESCAPE and text[1 : 1 + n] in SEQUENCES), 0)
        key, text = text[: 1 + length], text[1 + length :]
        name = SEQUENCES.get(key[1:]) or CONTROLS.get(key)
        code = KEY_CODES[name] if name else ord(key.lower())
        codes.append(code if code in CODES else 0)
    return codes


class KeyTerminal:
    """Records the keys that are typed in the terminal.

    A key counts as held for `hold_s` after the terminal has sent it. A terminal starts to repeat a held key only after
    about half a second, so `hold_s` should be longer.

    Args:
        keys: Object that is informed of each key that goes down or up.
        hold_s: Time for which a key counts as held after the terminal sent it [s].

    Raises:
        DeviceError: If standard input is not a terminal.
    """

    def __init__(self, keys: HeldKeys, hold_s: float) -> None:
        self._keys, self._hold_s = keys, hold_s
        self._until_s: dict[int, float] = {}
        self._file = sys.stdin.fileno()
        try:
            self._settings = termios.tcgetattr(self._file)
            tty.setcbreak(self._file)
        except termios.error as error:
            raise DeviceError("keyboard", f"its standard input is no terminal: {error}") from None

    def wait(self, timeout_s: float) -> None:
        """Waits until a key is typed or a key's holding time ends, and records keys that were typed or released.

        Args:
            timeout_s: Longest time to wait [s].

        Raises:
            DeviceError: If the terminal was closed.
        """
        due_s = min(self._until_s.values(), default=float("inf"))
        timeout_s = max(0.0, min(timeout_s, due_s - time.monotonic()))
        is_typed = select.select([self._file], [], [], timeout_s)[0]
        # Both loops use the same time, so that a key typed now stays held until at least the next call
        now_s = time.monotonic()
        if is_typed:
            try:
                typed = os.read(self._file, MAX_BYTES)
            except OSError as error:
                raise DeviceError("keyboard", f"its terminal has gone: {error}") from None
            if not typed:
                raise DeviceError("keyboard", "its terminal has gone")
            for code in codes_in(typed.decode(errors="replace")):
                self._keys.press(code)
                self._until_s[code] = now_s + self._hold_s
        for code, until_s in [*self._until_s.items()]:
            if now_s >= until_s:
                del self._until_s[code]
                self._keys.release(code)

    def close(self) -> None:
        """Restores the original settings of the terminal."""
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._file, termios.TCSANOW, self._settings)  # TCSANOW does not wait for output
