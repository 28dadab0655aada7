"""Reports errors in other packages' code with the name of the failing class, and checks samples of sensors."""

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
    """Returns True if a class or function, or the class of any other object, is defined outside this package."""
    return full_name(thing).split(":")[0].split(".")[0] != _OWN_PACKAGE


def raise_plugin_error(thing: Any, doing: str, error: Exception) -> None:
    """Raises a PluginError for an error in code of another package.

    Returns without effect if the error is an InterfaceError, or if the code belongs to this package. Errors in this
    package's own classes are bugs, and keep their traceback.

    Args:
        thing: The class, function or object that failed.
        doing: The action that failed, such as `compute`, for the error message.
        error: The error.

    Raises:
        PluginError: If `thing` is from another package, and `error` is not an InterfaceError.
    """
    if is_foreign(thing) and not isinstance(error, InterfaceError):
        raise PluginError(full_name(thing), doing, cause_of(error)) from error


@contextmanager
def plugin_errors(thing: Any, doing: str) -> Iterator[None]:
    """Passes an error in a `with` block to `raise_plugin_error`; raises the error unchanged if that call returns."""
    try:
        yield
    except Exception as error:
        raise_plugin_error(thing, doing, error)
        raise


def check_sample(sample: Any, sample_type: Any, name: str) -> None:
    """Checks a sample of a sensor.

    Args:
        sample: The sample.
        sample_type: Expected class of the sample.
        name: Name of the sensor; the sample must have the same name.

    Raises:
        TypeError: If the sample has another class.
        ValueError: If the sample has another name, or contains a non-finite number.
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
