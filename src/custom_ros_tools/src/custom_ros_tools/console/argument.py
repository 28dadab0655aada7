"""Arguments of commands, as annotations of the parameters of their functions."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError


class Argument(NamedTuple):
    """Metadata of a parameter, for `Annotated`.

    A keyword-only parameter is an option; all others are positional arguments.

    Attributes:
        shown: Placeholders of its words on the page, such as `X Y Z`. `NAME ...` means one word or more,
            `[NAME ...]` for any number of words.
        flag: Name of an option, by default `--` and the name of the parameter.
        parse: Returns the value of a word, or raises ValueError if the word is invalid.
        choices: Returns the valid words.
        is_open: Whether other words are valid too; the function checks them.
        offers: Name of a function in `dev/tools/completion.bash` that prints the words for completion.
        files: Pattern of the files that completion offers; empty for none.
        excludes: Name of a group of options of which at most one may be given.
        is_raw: Whether the function parses all words itself, options included.
    """

    shown: str
    flag: str = ""
    parse: Callable[[str], Any] = str
    choices: Callable[[], Iterable[str]] | None = None
    is_open: bool = False
    offers: str = ""
    files: str = ""
    excludes: str = ""
    is_raw: bool = False


class UsageError(InterfaceError):
    """The words of a command do not fit together; the message is printed after the usage, and the exit code is 2."""


class WrongNumberError(InterfaceError, ValueError):
    """A word is not a finite number."""


def number(text: str) -> float:
    """Returns the number in a word; `30deg` is a number in radians.

    Raises:
        WrongNumberError: If the word is not a number, or not finite.
    """
    is_angle = text.endswith("deg")
    try:
        value = float(text.removesuffix("deg"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise WrongNumberError(f"expected a number, got {text.strip()}")
    return math.radians(value) if is_angle else value
