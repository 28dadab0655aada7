"""Names and codes of keys, tracking of held keys, and their conversion to axes and buttons."""

import math
import time
from collections.abc import Collection, Set
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field

from custom_ros_tools.errors import hint
from custom_ros_tools.schema import AlsoTakes, Expects, ListOf
from operator_node.device import Reading

KEY_CODES: dict[str, int] = {
    "UNKNOWN": 0,
    "BACKSPACE": 8,
    "TAB": 9,
    "CLEAR": 12,
    "RETURN": 13,
    "PAUSE": 19,
    "ESCAPE": 27,
    "SPACE": 32,
    "EXCLAIM": 33,
    "QUOTEDBL": 34,
    "HASH": 35,
    "DOLLAR": 36,
    "AMPERSAND": 38,
    "QUOTE": 39,
    "LEFTPAREN": 40,
    "RIGHTPAREN": 41,
    "ASTERISK": 42,
    "PLUS": 43,
    "COMMA": 44,
    "MINUS": 45,
    "PERIOD": 46,
    "SLASH": 47,
    **{chr(code): code for code in range(ord("0"), ord("9") + 1)},
    "COLON": 58,
    "SEMICOLON": 59,
    "LESS": 60,
    "EQUALS": 61,
    "GREATER": 62,
    "QUESTION": 63,
    "AT": 64,
    "LEFTBRACKET": 91,
    "BACKSLASH": 92,
    "RIGHTBRACKET": 93,
    "CARET": 94,
    "UNDERSCORE": 95,
    "BACKQUOTE": 96,
    **{chr(code): code for code in range(ord("a"), ord("z") + 1)},
    "DELETE": 127,
    **{f"WORLD_{number}": 160 + number for number in range(96)},
    **{f"KP{number}": 256 + number for number in range(10)},
    "KP_PERIOD": 266,
    "KP_DIVIDE": 267,
    "KP_MULTIPLY": 268,
    "KP_MINUS": 269,
    "KP_PLUS": 270,
    "KP_ENTER": 271,
    "KP_EQUALS": 272,
    "UP": 273,
    "DOWN": 274,
    "RIGHT": 275,
    "LEFT": 276,
    "INSERT": 277,
    "HOME": 278,
    "END": 279,
    "PAGEUP": 280,
    "PAGEDOWN": 281,
    **{f"F{number}": 281 + number for number in range(1, 16)},
    "NUMLOCK": 300,
    "CAPSLOCK": 301,
    "SCROLLOCK": 302,
    "RSHIFT": 303,
    "LSHIFT": 304,
    "RCTRL": 305,
    "LCTRL": 306,
    "RALT": 307,
    "LALT": 308,
    "RMETA": 309,
    "LMETA": 310,
    "LSUPER": 311,
    "RSUPER": 312,
    "MODE": 313,
    "COMPOSE": 314,
    "HELP": 315,
    "PRINT": 316,
    "SYSREQ": 317,
    "BREAK": 318,
    "MENU": 319,
    "POWER": 320,
    "EURO": 321,
    "UNDO": 322,
}
"""Maps the name of each key, the part after `KEY_` in `keyboard/Key`, to its code, which is the code in SDL 1.2."""
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
"""Maps the key code of each modifier to the bit of this modifier in `keyboard/Key`."""
NUM_LOCK, CAPS_LOCK = 4096, 8192
"""Bits of the locks, which are modifiers that stay on without being held."""


def _digit_as_text(value: Any) -> Any:
    return str(value) if type(value) is int and 0 <= value <= 9 else value


def _known_key(name: str) -> str:
    if name not in KEY_CODES:
        raise ValueError(f"unknown key '{name}'{hint(name, KEY_CODES)}")
    return name


KeyName = Annotated[
    str,
    BeforeValidator(_digit_as_text),
    AfterValidator(_known_key),
    AlsoTakes({"type": "integer", "minimum": 0, "maximum": 9}),
    Expects("the name of a key, such as LEFT or b"),
]
"""Name of a key. Integers from 0 to 9 are accepted, too, since YAML reads the name of a digit key as a number."""
KeyPair = Annotated[tuple[KeyName, KeyName], Field(strict=False)]
"""Names of the negative key and the positive key of an axis."""


class KeyAxes:
    """Maps held keys to axes and buttons.

    An axis is 1 while only its positive key is held, -1 while only its negative key is held, and 0 while both or
    neither are held. A button is 1 while its key is held.

    Args:
        axes: Names of the negative and the positive key of each axis.
        buttons: Name of the key for each button.
    """

    def __init__(self, axes: ListOf[KeyPair], buttons: ListOf[KeyName] = ()) -> None:
        self._axes = [(KEY_CODES[negative], KEY_CODES[positive]) for negative, positive in axes]
        self._buttons = [KEY_CODES[name] for name in buttons]

    def reading(self, held: Collection[int]) -> Reading:
        """Returns the axes and buttons that result from the codes of the held keys."""
        axes = tuple(float((positive in held) - (negative in held)) for negative, positive in self._axes)
        return Reading(axes, tuple(int(code in held) for code in self._buttons))


class KeyEvent(NamedTuple):
    """A key that went down or up.

    Attributes:
        code: Code of the key, see `KEY_CODES`.
        modifiers: Sum of the bits of the modifiers that were held or locked.
        is_down: True if the key went down, False if it went up.
    """

    code: int
    modifiers: int
    is_down: bool


class HeldKeys:
    """Tracks which keys are held, and repeats the key that went down last while it is held.

    Args:
        repeats: Whether held keys are repeated.
        delay_s: Time for which a key is held before it is repeated [s].
        interval_s: Time between two repetitions [s].
    """

    def __init__(self, repeats: bool, delay_s: float, interval_s: float) -> None:
        self._repeats, self._delay_s, self._interval_s = repeats, delay_s, interval_s
        self._held: dict[int, None] = {}
        self._events: list[KeyEvent] = []
        self._repeating = 0
        self._repeat_at_s = math.inf

    @property
    def codes(self) -> Set[int]:
        """Codes of the held keys, in the order in which they went down."""
        return self._held.keys()

    @property
    def repeat_at_s(self) -> float:
        """Time of `time.monotonic` at which the next repetition is due [s]; infinity if no key is to be repeated."""
        return self._repeat_at_s

    def press(self, code: int, locks: int = 0) -> None:
        """Records that a key went down; ignores a key that is held already.

        Args:
            code: Code of the key.
            locks: Sum of the bits of the locks that are on.
        """
        if code in self._held:
            return
        self._events.append(KeyEvent(code, self._modifiers(locks), True))
        self._held[code] = None
        if self._repeats and code not in MODIFIERS:
            self._repeating, self._repeat_at_s = code, time.monotonic() + self._delay_s

    def release(self, code: int, locks: int = 0) -> None:
        """Records that a key went up; ignores a key that is not held.

        Args:
            code: Code of the key.
            locks: Sum of the bits of the locks that are on.
        """
        if code not in self._held:
            return
        del self._held[code]
        self._events.append(KeyEvent(code, self._modifiers(locks), False))
        if code == self._repeating:
            self._repeat_at_s = math.inf

    def release_all(self) -> None:
        """Records that all held keys went up, starting with the key that went down last."""
        for code in [*reversed(self._held)]:
            self.release(code)

    def drain_events(self) -> tuple[KeyEvent, ...]:
        """Returns and clears the events since the last call. A repetition that is due is the last event."""
        now_s = time.monotonic()
        if now_s >= self._repeat_at_s:
            self._events.append(KeyEvent(self._repeating, self._modifiers(0), True))
            self._repeat_at_s = now_s + self._interval_s
        events, self._events = tuple(self._events), []
        return events

    def _modifiers(self, locks: int) -> int:
        return locks + sum(MODIFIERS.get(code, 0) for code in self._held)
