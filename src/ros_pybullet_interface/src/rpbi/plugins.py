"""What classes of other packages must have, and errors that name them when they fail."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationInfo

from custom_ros_tools.errors import ConfigError, InterfaceError, PluginError
from custom_ros_tools.plugins import cause_of, full_name, own_folders
from custom_ros_tools.schema import ConfigModel, InnerProblemsError, KeyedError
from custom_ros_tools.schema.type_names import shown

_Kind = TypeVar("_Kind")
_Model = TypeVar("_Model", bound=ConfigModel)

_OWN_PACKAGE = __name__.split(".")[0]
own_folders.append(str(Path(__file__).parent))


def config_of(found: Any, base: type[_Kind]) -> type[_Kind]:
    """Returns the model of the YAML of a class.

    Raises:
        ValueError: If it has none, or another one.
    """
    model = getattr(found, "Config", None)
    if isinstance(model, type) and issubclass(model, base):
        return model
    raise ValueError(f"expected a Config in '{full_name(found)}' that is a subclass of {full_name(base)}")


def entry_config(
    entry: Any, info: ValidationInfo, base: type[_Model], class_of: Callable[[str], Any], expected: str
) -> _Model:
    """Returns the configuration of an entry with a `type`, by the model of its class; for pydantic's validators.

    Args:
        entry: What YAML says, or the configuration itself.
        base: What the configuration is at least.
        class_of: Returns the class of a type; it raises ValueError if there is none.
        expected: What was expected if it is no mapping with a type.

    Raises:
        ValueError: If it does not fit.
    """
    if isinstance(entry, base):
        return entry
    kind = entry.get("type") if isinstance(entry, Mapping) else None
    if not isinstance(kind, str):
        raise ValueError(f"expected {expected}; got {shown(entry)}")
    try:
        model = config_of(class_of(kind), base)
    except ValueError as error:
        raise KeyedError("type", str(error)) from None
    context = info.context or {}
    try:
        return model.parse(entry, context.get("file", ""), context)
    except ConfigError as error:
        raise InnerProblemsError(error.problems) from None


def is_foreign(thing: Any) -> bool:
    """Tells whether a class or function, or the class of anything else, comes from another package."""
    return full_name(thing).split(":")[0].split(".")[0] != _OWN_PACKAGE


def blame(thing: Any, doing: str, error: Exception) -> None:
    """Raises a PluginError if something of another package failed, unless that said what is wrong in our own way.

    Errors of this package's own classes are left alone: they are bugs, of which all should be seen.

    Args:
        thing: What failed: a class, a function, or an object of such a class.
        doing: What it was doing.
        error: What it raised.

    Raises:
        PluginError: In that case.
    """
    if is_foreign(thing) and not isinstance(error, InterfaceError):
        raise PluginError(full_name(thing), doing, cause_of(error)) from error


@contextmanager
def blaming(thing: Any, doing: str) -> Iterator[None]:
    """Blames something for all that goes wrong meanwhile, see `blame`."""
    try:
        yield
    except Exception as error:
        blame(thing, doing, error)
        raise


def check_sample(sample: Any, sample_type: Any, name: str) -> None:
    """Checks what a sensor has read.

    Raises:
        TypeError: If it is something else.
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
