"""Two sources of configuration whose faults are told together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from .errors import ConfigError, Problem

First = TypeVar("First")
Second = TypeVar("Second")


def both(first: Callable[[], First], second: Callable[[], Second]) -> tuple[First, Second]:
    """Return what two functions return, after both were called.

    Args:
        first: Reads one part of a configuration.
        second: Reads another one.

    Raises:
        ConfigError: If they raise it; it has the problems of both.
    """
    results: list[Any] = []
    problems: list[Problem] = []
    for read in (first, second):
        try:
            results.append(read())
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    return results[0], results[1]
