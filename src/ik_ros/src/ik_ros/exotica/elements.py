"""Pydantic models of the XML elements of an EXOTica problem, and EXOTica's notations of rotations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import ConfigModel, InnerProblemsError, Text
from robot_model.asset_files import ExistingFile
from robot_model.geometry import Pose, Quaternion, normalized

from .records import XmlRecord

Element = TypeVar("Element", bound="ElementConfig")
MAX_NUMBERS = 10_000


def _checked_quaternion(numbers: Sequence[float]) -> Rotation:
    if math.hypot(*numbers) < 1e-6:
        raise ValueError("expected a quaternion x, y, z, w that is not zero")
    return Rotation.from_quat(numbers)


def _checked_matrix(numbers: Sequence[float]) -> Rotation:
    matrix = np.array(numbers).reshape(3, 3)
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3) or np.linalg.det(matrix) < 0.0:
        raise ValueError("expected the nine numbers of a rotation matrix, row by row")
    return Rotation.from_matrix(matrix)


NOTATIONS: Mapping[str, tuple[int, Callable[[Sequence[float]], Rotation]]] = {
    "RPY": (3, lambda numbers: Rotation.from_euler("xyz", numbers)),
    "ZYX": (3, lambda numbers: Rotation.from_euler("ZYX", numbers)),
    "ZYZ": (3, lambda numbers: Rotation.from_euler("ZYZ", numbers)),
    "AngleAxis": (3, Rotation.from_rotvec),
    "Quaternion": (4, _checked_quaternion),
    "Matrix": (9, _checked_matrix),
}
"""Number of values for each notation of a rotation, and the function that converts the values to a rotation."""


def rotation_of(notation: str, numbers: Sequence[float]) -> Quaternion:
    """Converts a rotation to a quaternion x, y, z, w.

    Args:
        notation: A key of `NOTATIONS`.
        numbers: The rotation in this notation.

    Raises:
        ValueError: If the numbers are not a rotation, or their count is wrong.
    """
    count, make = NOTATIONS[notation]
    if len(numbers) != count:
        raise ValueError(f"expected {count} numbers for a rotation as {notation}, got {len(numbers)}")
    x, y, z, w = make(numbers).as_quat().tolist()
    return x, y, z, w


def _numbers(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    words = value.split()
    if len(words) > MAX_NUMBERS:
        raise ValueError(f"expected at most {MAX_NUMBERS} numbers, got {len(words)}")
    try:
        return tuple(float(word) for word in words)
    except ValueError:
        raise ValueError(f"expected numbers with spaces between them, got {value[:60]!r}") from None


def _number(value: Any) -> Any:
    numbers = _numbers(value)
    if isinstance(numbers, tuple) and len(numbers) != 1:
        raise ValueError(f"expected one number, got {len(numbers)}")
    return numbers[0] if isinstance(numbers, tuple) else numbers


def _whole(value: Any) -> Any:
    number = _number(value)
    return int(number) if isinstance(number, float) and number.is_integer() else number


def _flag(value: Any) -> Any:
    return {"true": True, "1": True, "false": False, "0": False}.get(str(value).strip().lower(), value)


def pose_of(numbers: tuple[float, ...]) -> Pose:
    """Converts numbers to a pose.

    Args:
        numbers: Position x, y, z [m], alone or followed by roll, pitch, yaw [rad] or by a quaternion x, y, z, w.

    Raises:
        ValueError: If there are not 3, 6 or 7 finite numbers, or the quaternion is 0.
    """
    if len(numbers) not in (3, 6, 7) or not all(map(math.isfinite, numbers)):
        raise ValueError(f"expected 3, 6 or 7 finite numbers, got {list(numbers)}")
    x, y, z, *turn = numbers
    if not turn:
        return Pose((x, y, z))
    return Pose((x, y, z), normalized(rotation_of("RPY" if len(turn) == 3 else "Quaternion", turn)))


def _pose(value: Any) -> Any:
    return pose_of(_numbers(value)) if isinstance(value, str) else value


Numbers = Annotated[tuple[float, ...], BeforeValidator(_numbers)]
Number = Annotated[float, BeforeValidator(_number)]
Whole = Annotated[int, BeforeValidator(_whole)]
Flag = Annotated[bool, BeforeValidator(_flag)]
PoseNumbers = Annotated[Pose, BeforeValidator(_pose)]


class ElementConfig(ConfigModel):
    """Base class of the models of XML elements.

    Attributes:
        IGNORED: Names of EXOTica's fields that are accepted but have no effect here.
    """

    IGNORED: ClassVar[frozenset[str]] = frozenset(("Debug",))
    Name: str = ""


def element_of(model: type[Element], record: XmlRecord, file: str) -> Element:
    """Validates an XML element, and returns an instance of the element's model.

    Args:
        model: Pydantic model of the element.
        record: The element, as read from XML.
        file: Path of the XML file, for messages and relative paths.

    Raises:
        ConfigError: If a field is invalid; the keys in the error are relative to the element.
    """
    fields = {key: value for key, value in record.fields.items() if key not in model.IGNORED}
    return model.parse(fields, file)


def list_of(models: Callable[[], Mapping[str, type[ElementConfig]]], kind: str) -> BeforeValidator:
    """Makes the validator of a field that contains a list of elements.

    Args:
        models: Function that returns the allowed models by tag. Elements with other tags are rejected.
        kind: Noun for an element of the list, for error messages.
    """

    def check(value: Any, info: ValidationInfo) -> Any:
        if value == "":
            return ()
        if not isinstance(value, list) or not all(isinstance(each, XmlRecord) for each in value):
            return value if isinstance(value, tuple) else _refuse(kind, value)
        elements: list[ElementConfig] = []
        problems: list[Problem] = []
        for record in value:
            label = str(record.fields.get("Name", "")) or record.kind
            if record.kind not in models():
                problems.append(Problem("", label, str(UnknownNameError(kind, record.kind, models()))))
                continue
            try:
                elements.append(element_of(models()[record.kind], record, (info.context or {}).get("file", "")))
            except ConfigError as error:
                problems += [Problem("", f"{label}.{each.key}".rstrip("."), each.message) for each in error.problems]
        if problems:
            raise InnerProblemsError(problems)
        return tuple(elements)

    return BeforeValidator(check)


def _refuse(kind: str, value: Any) -> Any:
    raise ValueError(f"expected elements, each a {kind}, got {str(value)[:60]!r}")


class MapFrame(ElementConfig):
    """A frame of a task map: the frame `Link`, relative to the frame `Base`, each displaced by its offset."""

    Link: Text
    LinkOffset: PoseNumbers = Pose()
    Base: str = ""
    BaseOffset: PoseNumbers = Pose()


class LinkConfig(ElementConfig):
    """An additional frame of the scene, which does not belong to the robot."""

    IGNORED = frozenset(("Debug", "Mass", "CenterOfMass", "Shape"))
    Name: Text
    Transform: PoseNumbers = Pose()
    Parent: str = ""


class SceneConfig(ElementConfig):
    """The scene: a robot, its joint group, and additional frames. Collisions are not checked."""

    IGNORED = frozenset(
        (
            "Debug",
            "RobotDescription",
            "SetRobotDescriptionRosParams",
            "CollisionScene",
            "AlwaysUpdateCollisionScene",
            "DoNotInstantiateCollisionScene",
            "RobotLinksToExcludeFromCollisionScene",
            "WorldLinksToExcludeFromCollisionScene",
        )
    )
    JointGroup: Text
    URDF: ExistingFile
    SRDF: ExistingFile
    Links: Annotated[tuple[LinkConfig, ...], list_of(lambda: {"Link": LinkConfig}, "link of a scene")] = ()


class CostConfig(ElementConfig):
    """An XML element that makes a task map a cost: the map's name, its weights `Rho`, and the goal of its values."""

    Task: Text
    Rho: Numbers = ()
    Goal: Numbers = ()


class SolverConfig(ElementConfig):
    """The element `IKSolver`, of which only the number of iterations has an effect here."""

    IGNORED = frozenset(
        (
            "Debug",
            "MaxStep",
            "Tolerance",
            "Convergence",
            "C",
            "Alpha",
            "RegularizationRate",
            "MinimumRegularization",
            "MaximumRegularization",
            "ThresholdRegularizationIncrease",
            "ThresholdRegularizationDecrease",
            "StepToleranceConvergenceThreshold",
            "GradientToleranceConvergenceThreshold",
        )
    )
    MaxIterations: Annotated[Whole, Field(gt=0, le=100_000)] = 100
