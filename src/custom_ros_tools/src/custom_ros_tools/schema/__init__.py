"""Base class of strict configuration models, and types for numbers and texts in YAML files.

A model declares keys, units and limits once. Validation, error messages and the JSON Schema are derived from the model.
"""

import copy
import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, WithJsonSchema

from custom_ros_tools.errors import ConfigError, Problem, shortened

from .annotations import AlsoTakes as AlsoTakes
from .annotations import Expects as Expects
from .annotations import InnerProblemsError as InnerProblemsError
from .annotations import KeyedError as KeyedError
from .annotations import Unit as Unit
from .annotations import optional as optional
from .errors import problems_of

Model = TypeVar("Model", bound="ConfigModel")
Item = TypeVar("Item")

_NAME = r"[A-Za-z0-9_]+"
_FRAME_ID = r"[^\s/](\S*[^\s/])?"


class ConfigModel(BaseModel):
    """Base class of all configuration models, which are immutable and picklable, and reject unknown keys.

    An integer is accepted where a float is expected, and a list where a tuple is expected. All other values of wrong
    types are rejected.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True)

    @classmethod
    def parse(cls: type[Model], data: Mapping[str, Any], file: str, context: Mapping[str, Any] | None = None) -> Model:
        """Validates the content of a file.

        Args:
            data: Content of the file, which is copied.
            file: Name of the file, for error messages; `"~config"` for a configuration from the parameter server.
            context: Additional entries of `info.context` for validators, such as the folders to search.

        Raises:
            ConfigError: If the content is invalid; the error contains a `Problem` for each fault.
        """
        if not isinstance(data, Mapping):
            got = "nothing" if data is None else type(data).__name__
            raise ConfigError([Problem(file, "", f"expected a mapping of keys to values, got {got}")])
        plain = copy.deepcopy(dict(data))
        try:
            return cls.model_validate(plain, context={"file": file, **(context or {})})
        except ValidationError as error:
            raise ConfigError(problems_of(error, cls, plain, file)) from None


def _unit_quaternion(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.sqrt(sum(v * v for v in value))
    if norm < 1e-6:
        raise ValueError("a quaternion cannot be all zeros; no rotation is [0, 0, 0, 1]")
    if abs(norm - 1.0) < 1e-12:
        return value  # normalising again must not change the last bit
    return tuple(v / norm for v in value)


def _direction(value: tuple[float, ...]) -> tuple[float, ...]:
    if math.hypot(*value) < 1e-6:
        raise ValueError("a direction cannot be all zeros")
    return value


def _switch(value: Any) -> Any:
    return bool(value) if type(value) is int and value in (0, 1) else value


def _name(value: str) -> str:
    if not re.fullmatch(_NAME, value):
        raise ValueError(f"use letters, digits and '_' only (topics and frames are named after it), got {value!r}")
    return value


def _frame_id(value: str) -> str:
    if not re.fullmatch(_FRAME_ID, value):
        raise ValueError(f"a TF frame has no spaces and neither starts nor ends with '/', got {value!r}")
    return value


def _one_as_list(given: Any) -> Any:
    return [given] if isinstance(given, (int, float)) and not isinstance(given, bool) else given


def _within(largest: float, unit: str = "") -> AfterValidator:
    """Makes a validator that rejects numbers whose magnitude exceeds `largest`; `unit` appears in the error message."""

    def check(value: Any) -> Any:
        for number in value if isinstance(value, tuple) else (value,):
            if abs(number) > largest:
                got = f"{number:g}" if isinstance(number, float) else shortened(str(number))
                raise ValueError(f"must be within +-{largest:g}{unit and f' [{unit}]'}, got {got}")
        return value

    return AfterValidator(check)


MAX_COORDINATE_M = 1e6
"""Largest accepted magnitude of a coordinate [m]. With larger coordinates, a body's state may become infinite."""
HEAVIEST_KG = 1e9
_MAX_NUMBER, _MAX_COUNT = 1e12, 2**31 - 1

Positive = Annotated[float, Field(gt=0), _within(_MAX_NUMBER)]
NonNegative = Annotated[float, Field(ge=0), _within(_MAX_NUMBER)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0), _within(_MAX_COUNT)]
Hz = Annotated[float, Field(gt=0), Unit("Hz")]
HzOrOff = Annotated[float, Field(ge=0), Unit("Hz")]
"""A rate [Hz]; 0 means that the action with this rate is disabled."""
Seconds = Annotated[float, Field(gt=0), Unit("s")]
Pixels = Annotated[int, Field(gt=0, le=8192), Unit("px")]
Metres = Annotated[float, _within(MAX_COORDINATE_M, "m"), Unit("m")]
NonNegativeMetres = Annotated[float, Field(ge=0), _within(MAX_COORDINATE_M, "m"), Unit("m")]
PositiveMetres = Annotated[float, Field(gt=0), _within(MAX_COORDINATE_M, "m"), Unit("m")]
Kilograms = Annotated[float, Field(ge=0), _within(HEAVIEST_KG, "kg"), Unit("kg")]
PositiveKilograms = Annotated[float, Field(gt=0), _within(HEAVIEST_KG, "kg"), Unit("kg")]
Degrees = Annotated[float, Unit("deg")]

Vec3 = Annotated[tuple[float, float, float], Field(strict=False), _within(MAX_COORDINATE_M)]
Position = Annotated[Vec3, Unit("m")]
Direction = Annotated[Vec3, AfterValidator(_direction)]
"""A direction vector x, y, z of any length but zero."""
Quat = Annotated[tuple[float, float, float, float], Field(strict=False), AfterValidator(_unit_quaternion)]
"""A quaternion x, y, z, w of any length but zero, which is normalised."""
Rgba = Annotated[tuple[Fraction, Fraction, Fraction, Fraction], Field(strict=False)]
Rgb = Annotated[tuple[Fraction, Fraction, Fraction], Field(strict=False)]
ListOf = Annotated[tuple[Item, ...], Field(strict=False)]
"""A list of any length, such as `ListOf[float]`, which is stored as a tuple."""
OneAsList = BeforeValidator(_one_as_list)
"""Validator for lists that converts a single number to a list with one item."""

Switch = Annotated[
    bool,
    BeforeValidator(_switch),
    WithJsonSchema({"type": ["boolean", "integer"], "minimum": 0, "maximum": 1}),
]
"""True or false; 1 and 0, which are usual with PyBullet, are accepted as well."""
Text = Annotated[str, Field(min_length=1)]
Name = Annotated[
    str, AfterValidator(_name), WithJsonSchema({"type": "string", "pattern": f"^{_NAME}$"}), Expects("a name")
]
"""Name of an object: letters, digits and '_'."""
TopicName = Annotated[str, Field(pattern=r"^[~/A-Za-z][A-Za-z0-9_/]*$"), Expects("the name of a topic")]
"""Relative, private or absolute name of a topic."""
FrameId = Annotated[
    str,
    AfterValidator(_frame_id),
    WithJsonSchema({"type": "string", "pattern": f"^{_FRAME_ID}$"}),
    Expects("a TF frame"),
]
