"""Annotations of function parameters that describe the arguments of commands."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError


class Argument(NamedTuple):
    """Describes how a function parameter is given on the command line; used as metadata in `Annotated`.

    A keyword-only parameter is an option. All other parameters are positional arguments.

    Attributes:
        shown: Placeholders for the argument's words in the help text, such as `X Y Z`. `NAME ...` means one or more
            words, `[NAME ...]` means any number of words.
        flag: Name of the option; by default `--` and the name of the parameter.
        parse: Function that converts a word to a value, or raises a ValueError if the word is invalid.
        choices: Function that returns the valid words. None: all words that `parse` accepts are valid.
        is_open: Whether words that are not in `choices` are accepted as well; the command's function checks them.
        offers: Name of a function in `dev/tools/completion.bash` that prints words for completion.
        files: Pattern of the file names that completion offers; empty if completion does not offer files.
        excludes: Name of a group of mutually exclusive options.
        is_raw: Whether the command's function gets all words unparsed, including options.
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
    """The arguments of a command are invalid. The command prints usage and message, and exits with code 2."""


class WrongNumberError(InterfaceError, ValueError):
    """An argument is not a finite number."""


def number(text: str) -> float:
    """Converts a word to a number. An angle in degrees, such as `30deg`, is converted to radians.

    Raises:
        WrongNumberError: If the word is not a finite number.
    """
    is_angle = text.endswith("deg")
    try:
        value = float(text.removesuffix("deg"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise WrongNumberError(f"expected a number, got {text.strip()}")
    return math.radians(value) if is_angle else value
