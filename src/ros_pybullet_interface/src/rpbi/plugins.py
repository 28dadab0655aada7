"""Errors that name the class of another package when it fails, and checks of its samples."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from custom_ros_tools.errors import InterfaceError, PluginError
from custom_ros_tools.plugins import cause_of, full_name, own_folders

_OWN_PACKAGE = __name__.split(".")[0]
own_folders.append(str(Path(__file__).parent))


def is_foreign(thing: Any) -> bool:
    """Returns whether a class, a function, or the class of an object comes from another package."""
    return full_name(thing).split(":")[0].split(".")[0] != _OWN_PACKAGE


def raise_plugin_error(thing: Any, doing: str, error: Exception) -> None:
    """Raises a PluginError for an error in code of another package, unless it is an InterfaceError.

    Errors of this package's own classes are bugs, and keep their traceback.

    Args:
        thing: The class, function or object that failed.
        doing: Its action, for the message.
        error: The error that it raised.

    Raises:
        PluginError: In that case.
    """
    if is_foreign(thing) and not isinstance(error, InterfaceError):
        raise PluginError(full_name(thing), doing, cause_of(error)) from error


@contextmanager
def plugin_errors(thing: Any, doing: str) -> Iterator[None]:
    """Passes all errors of its block to `raise_plugin_error`."""
    try:
        yield
    except Exception as error:
        raise_plugin_error(thing, doing, error)
        raise


def check_sample(sample: Any, sample_type: Any, name: str) -> None:
    """Checks a sample of a sensor.

    Raises:
        TypeError: If it has another type.
        ValueError: If it has another name, or a number in it is not finite.
    """
    if type(sample) is not sample_type:
        raise TypeError(f"expected a {sample_type.__qualname__}, as sample_type says; got {sample!r}")
    if sample.name != name:
        raise ValueError(f"expected the sensor's name '{name}' in the sample, got '{sample.name}'")
    if not _is_finite(sample if isinstance(sample, tuple) else vars(sample)):
        raise ValueError(f"the sample has a number that is not finite: {sample!r}")


def _is_finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, Mapping):
        return all(map(_is_finite, value.values()))
    if isinstance(value, (tuple, list)):
        return all(map(_is_finite, value))
    if hasattr(value, "dtype"):
        return value.dtype.kind != "f" or math.isfinite(value.sum())
    return True
