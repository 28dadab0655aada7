"""Writes Python objects as plain data for JSON, and converts the data back to objects of the same structure.

The Python part of a world's state consists of the attributes of bodies, sensors, controllers and target streams. These
attributes are written as a graph: repeated occurrences of an object are written as references to the first occurrence.
Objects that the reading world also has, such as bodies, are called anchors and are written as their names only.
Reading sets the attributes of existing objects, and creates the objects that a freshly built world does not have yet.
The text contains class names, but no code, and only classes of trusted packages are instantiated.
"""

from __future__ import annotations

import enum
import math
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any

import numpy as np

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.plugins import check_trusted, find, full_name
from custom_ros_tools.schema import ConfigModel
from rpbi.plugins import is_foreign
from rpbi.samples import ContactsSample

_MADE = ("rpbi.bodies.", "rpbi.control.", "rpbi.engine.clock", "rpbi.samples", "rpbi.sensors.", "rpbi.world.")
"""Prefixes of the names of modules in `rpbi` from which reading may instantiate classes."""
_CALLED = ("rpbi.bodies.", "rpbi.control.", "rpbi.sensors.")
"""Prefixes of the names of modules in `rpbi` whose classes' methods a state may refer to."""
_KEPT = (FunctionType, BuiltinFunctionType, partial, type)
"""Types of attribute values that are code; they are not written, and reading leaves existing values unchanged."""
_NUMBERS = "fiub"
"""Kinds of NumPy data types (`dtype.kind`) that are allowed in arrays."""
NOTHING: Any = object()
"""Represents a missing object, since None is a valid value."""


class GraphWriter:
    """Converts objects to plain data that JSON can contain: None, booleans, numbers, text and lists.

    Args:
        fixed: Types whose objects are not written; the reader uses the corresponding objects of its own world.
        anchors: Objects that are written as their names only, indexed by name.
    """

    def __init__(self, fixed: tuple[type, ...], anchors: Mapping[str, Any]) -> None:
        self._fixed = fixed
        self._anchors = {id(anchor): name for name, anchor in anchors.items()}
        self._numbers: dict[int, int] = {}
        self._written: list[Any] = []
        """All written objects; the list keeps them alive, so that Python does not reuse their `id`."""

    def plain(self, value: Any, where: str = "") -> Any:
        """Returns a value as plain data, or a reference in plain data if the same object was written before.

        Args:
            value: Value to write.
            where: Attribute path of the value, for messages.

        Raises:
            InterfaceError: If the value cannot be written.
        """
        if value is None or type(value) in (bool, int, float, str):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, enum.Enum):
            return ["enum", full_name(type(value)), value.value]
        if isinstance(value, (int, float, str)):
            return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))
        if isinstance(value, MethodType):
            return ["method", self.plain(value.__self__, where), value.__name__]
        if isinstance(value, _KEPT):
            return ["kept"]
        if id(value) in self._anchors:
            return ["anchor", self._anchors[id(value)]]
        if (number := self._numbers.get(id(value))) is not None:
            return ["same", number]
        number = self._numbers[id(value)] = len(self._written)
        self._written.append(value)
        return [*self._content(value, where), number]

    def _content(self, value: Any, where: str) -> list[Any]:
        """Returns a list of plain data: the name of the value's kind, such as `array` or `dict`, then the content."""
        if isinstance(value, self._fixed):
            return ["fixed"]
        if isinstance(value, ConfigModel):
            return ["config", full_name(type(value)), value.model_dump(mode="json", exclude_unset=True)]
        if isinstance(value, Future):
            return ["future"]
        if isinstance(value, np.ndarray):
            if value.dtype.kind not in _NUMBERS:
                raise self._refused(value, where)
            return ["array", value.dtype.str, list(value.shape), value.ravel().tolist()]
        if isinstance(value, Mapping):
            items = [[self.plain(key, where), self.plain(item, f"{where}[{key!r}]")] for key, item in value.items()]
            return ["dict", items]
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            return ["named", full_name(type(value)), [self.plain(item, where) for item in value]]
        if isinstance(value, (set, frozenset)):
            return [type(value).__name__, [self.plain(item, where) for item in sorted(value, key=repr)]]
        if isinstance(value, (list, tuple)):
            return [type(value).__name__, [self.plain(item, where) for item in value]]
        if isinstance(value, deque):
            return ["deque", value.maxlen, [self.plain(item, where) for item in value]]
        if isinstance(value, np.random.Generator):
            return ["generator", type(value.bit_generator).__name__, self.plain(value.bit_generator.state, where)]
        if not _has_attributes(value):
            raise self._refused(value, where)
        return ["object", full_name(type(value)), self.attributes(value, where)]

    def attributes(self, value: Any, where: str) -> list[list[Any]]:
        """Returns each attribute of an object as a list of its name and its value as plain data.

        Leaves out the attributes that are listed in the class attribute `not_in_keyframes`.

        Args:
            value: The object.
            where: Attribute path of the object, for messages.

        Raises:
            InterfaceError: If an attribute cannot be written.
        """
        return [list(each) for each in self._attributes(value, where)]

    def _attributes(self, value: Any, where: str) -> Iterator[tuple[str, Any]]:
        left_out = getattr(type(value), "not_in_keyframes", ())
        if isinstance(value, ContactsSample):
            _ = value.points  # computes the cached points, since the data they are computed from is not written
        for name, attribute in _attributes_of(value):
            if name not in left_out:
                if isinstance(attribute, _KEPT) and is_foreign(value):
                    raise self._refused(attribute, f"{where}.{name}")
                yield name, self.plain(attribute, f"{where}.{name}")

    @staticmethod
    def _refused(value: Any, where: str) -> InterfaceError:
        kind = full_name(type(value))
        return InterfaceError(f"{where.lstrip('.')}: a keyframe holds numbers, texts, arrays and objects, got a {kind}")


def _has_attributes(value: Any) -> bool:
    """Returns whether the attributes of an object are its whole state.

    This is assumed if the object's class is written in Python and is not from the standard library.
    """
    kind = type(value)
    is_written = hasattr(value, "__dict__") or any("__slots__" in vars(each) for each in kind.__mro__)
    return is_written and kind.__module__.split(".")[0] not in sys.stdlib_module_names


def _attributes_of(value: Any) -> Iterator[tuple[str, Any]]:
    yield from vars(value).items() if hasattr(value, "__dict__") else ()
    for kind in type(value).__mro__:
        slots = vars(kind).get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(value, name):
                yield name, getattr(value, name)


class GraphReader:
    """Converts plain data of a GraphWriter back to objects; where possible, sets attributes of existing objects.

    Args:
        fixed: Types whose objects were not written; must equal the writer's `fixed`.
        anchors: Objects of the reading world that replace the writer's anchors, indexed by name.
    """

    def __init__(self, fixed: tuple[type, ...], anchors: Mapping[str, Any]) -> None:
        self._fixed, self._anchors = fixed, anchors
        self._read: dict[int, Any] = {}
        self._filled: set[int] = set()
        """The `id` of each filled object, so that no existing object is filled twice for different objects."""
        self._kinds: dict[str, Callable[..., Any]] = {
            "array": self._array,
            "config": self._config,
            "deque": self._deque,
            "fixed": lambda here: here,
            "frozenset": lambda here, items: frozenset(self._items(items, ())),
            "future": lambda here: Future(),
            "generator": self._generator,
            "list": lambda here, items: self._items(items, here),
            "named": self._named,
            "set": lambda here, items: set(self._items(items, ())),
            "tuple": lambda here, items: tuple(self._items(items, here)),
        }

    def value(self, plain: Any, here: Any = NOTHING) -> Any:
        """Converts plain data back to a value.

        Args:
            plain: Plain data from `GraphWriter.plain`.
            here: Existing value, which the caller replaces by the result; NOTHING without an existing value. If this
                value is an object of the class that the plain data name, sets its attributes and returns the object.

        Raises:
            ValueError: If the plain data are not valid, or a class is missing or not trusted.
            ConfigError: If a configuration in the plain data is not valid on this machine.
        """
        with _one_error():
            return self._value(plain, here)

    def fill(self, owner: Any, attributes: list[Any]) -> None:
        """Sets attributes of an object.

        Args:
            owner: The object.
            attributes: Pairs of name and plain data, from `GraphWriter.attributes`.

        Raises:
            ValueError: See `value`; also if a name is not a settable attribute.
            ConfigError: See `value`.
        """
        with _one_error():
            for attribute, plain in attributes:
                if attribute.startswith("__") or callable(getattr(type(owner), attribute, None)):
                    raise ValueError(f"'{attribute}' is no attribute of a state")
                value = self._value(plain, _attribute(owner, attribute))
                if value is not NOTHING:
                    object.__setattr__(owner, attribute, value)

    def _value(self, plain: Any, here: Any) -> Any:
        if not isinstance(plain, list):
            return plain
        kind, *content = plain
        if kind == "same":
            return self._read[content[0]]
        if kind == "anchor":
            return self._anchors[content[0]]
        if kind == "kept":
            return None if here is NOTHING else here
        if kind == "enum":
            return _class_of(content[0], enum.Enum)(content[1])
        if kind == "method":
            return self._method(*content)
        *content, number = content
        if kind == "object":
            return self._object(here, number, *content)
        if kind == "dict":
            return self._dict(here, number, *content)
        value = self._read[number] = self._kinds[kind](here, *content)
        return value

    def _object(self, here: Any, number: int, name: str, attributes: list[Any]) -> Any:
        made = here
        if here is NOTHING or full_name(type(here)) != name or id(here) in self._filled:
            kind = _class_of(name, object)
            if name.startswith("rpbi.") and not name.startswith(_MADE):
                raise ValueError(f"'{name}' does not come while a world runs")
            made = object.__new__(kind)
        self._read[number] = made
        self._filled.add(id(made))
        self.fill(made, attributes)
        return made

    def _method(self, owner: Any, name: str) -> Any:
        one = self._value(owner, NOTHING)
        kind = type(one)
        may_be_called = is_foreign(one) or kind.__module__.startswith(_CALLED)
        if not may_be_called or not isinstance(getattr(kind, name), FunctionType) or name[:2] == "__":
            raise ValueError(f"'{name}' is no method of {full_name(type(one))} that a state refers to")
        return getattr(one, name)

    def _dict(self, here: Any, number: int, items: list[Any]) -> dict[Any, Any]:
        before: dict[Any, Any] = here if isinstance(here, dict) else {}
        new = self._read[number] = {}
        for plain_key, plain in items:
            key = self._value(plain_key, NOTHING)
            new[key] = self._present(plain, before.get(key, NOTHING))
        return new

    def _deque(self, here: Any, longest: int | None, items: list[Any]) -> deque[Any]:
        return deque(self._items(items, ()), longest)

    def _named(self, here: Any, name: str, items: list[Any]) -> Any:
        kind: Any = _class_of(name, tuple)
        if not hasattr(kind, "_fields"):
            raise ValueError(f"'{name}' is no named tuple")
        return kind(*self._items(items, here if type(here) is kind else ()))

    def _items(self, items: list[Any], here: Any) -> list[Any]:
        before: Sequence[Any] = here if isinstance(here, (list, tuple)) and len(here) == len(items) else ()
        return [self._present(plain, before[index] if before else NOTHING) for index, plain in enumerate(items)]

    def _present(self, plain: Any, here: Any) -> Any:
        value = self._value(plain, here)
        if value is NOTHING:
            raise ValueError(f"a keyframe refers to an object that this world lacks: {plain!r:.200}")
        return value

    @staticmethod
    def _array(here: Any, kind: str, shape: list[int], numbers: list[Any]) -> Any:
        if np.dtype(kind).kind not in _NUMBERS or math.prod(shape) != len(numbers):
            raise ValueError(f"expected an array of shape {shape}, got {len(numbers)} numbers of type {kind!r}")
        return np.array(numbers, np.dtype(kind)).reshape(shape)

    @staticmethod
    def _config(here: Any, name: str, content: Any) -> Any:
        kind: Any = _class_of(name, ConfigModel)
        return kind.model_validate(content, context={"file": "~recorded"})

    def _generator(self, here: Any, name: str, state: Any) -> np.random.Generator:
        bits = {"PCG64": np.random.PCG64, "MT19937": np.random.MT19937, "Philox": np.random.Philox}[name]()
        bits.state = self._value(state, NOTHING)
        return np.random.Generator(bits)


@contextmanager
def _one_error() -> Iterator[None]:
    try:
        yield
    except (TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise ValueError(f"expected what a keyframe has, got {error!r}") from None


def _attribute(owner: Any, name: str) -> Any:
    """Returns an attribute's value from the object's `__dict__` or slots; NOTHING if it is in neither."""
    if name in getattr(owner, "__dict__", ()):
        return vars(owner)[name]
    slots = (name in vars(kind).get("__slots__", ()) for kind in type(owner).__mro__)
    return getattr(owner, name, NOTHING) if any(slots) else NOTHING


def _class_of(name: str, base: type) -> Any:
    """Returns the class with a given name.

    Args:
        name: Name as `module:Class`.
        base: Required base class.

    Raises:
        ValueError: If the class is missing, not from a trusted package, or not a subclass of `base`.
    """
    check_trusted(name)
    kind = find(name)
    if not isinstance(kind, type) or not issubclass(kind, base):
        raise ValueError(f"'{name}' is no {base.__name__}")
    return kind
