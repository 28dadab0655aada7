"""Names and codes of keys, and axes and buttons made from the keys that are held."""

from collections.abc import Collection
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from custom_ros_tools.errors import hint
from custom_ros_tools.schema import AlsoTakes, Expects, ListOf

from .device import Reading

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
"""Code of each key by its name, which is the part after `KEY_` in `keyboard/Key`; the codes are those of SDL 1.2."""


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
"""Name of a key; YAML reads 1 as a number, which stands for the key 1."""
KeyPair = Annotated[tuple[KeyName, KeyName], Field(strict=False)]
"""The two keys of an axis: the negative one and the positive one."""


class KeyAxes:
    """Maps held keys to axes and buttons.

    An axis is 1 while its positive key is held, -1 while its negative one is, and 0 with both or none; a button is 1
    while its key is held.

    Args:
        axes: Names of the negative and the positive key of each axis.
        buttons: Name of the key of each button.
    """

    def __init__(self, axes: ListOf[KeyPair], buttons: ListOf[KeyName] = ()) -> None:
        self._axes = [(KEY_CODES[negative], KEY_CODES[positive]) for negative, positive in axes]
        self._buttons = [KEY_CODES[name] for name in buttons]

    def reading(self, held: Collection[int]) -> Reading:
        """Returns axes and buttons for the codes of the keys that are held."""
        axes = tuple(float((positive in held) - (negative in held)) for negative, positive in self._axes)
        return Reading(axes, tuple(int(code in held) for code in self._buttons))
