"""PyBullet's constants by name, as YAML files say them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import pybullet
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from custom_ros_tools.errors import hint
from custom_ros_tools.schema.type_names import shown


@dataclass(frozen=True)
class Constants:
    """A family of PyBullet constants that exclude each other, such as the shape types.

    `Annotated[int, SHAPE_TYPES]` makes a field that takes a name or its number and holds the number.

    Attributes:
        kind: What they are, for messages.
        names: Their names in PyBullet.
    """

    kind: str
    names: tuple[str, ...]

    def parse(self, given: Any) -> int:
        """Return the number of one constant.

        Args:
            given: Its name or number.

        Raises:
            ValueError: if it is not of this family.
        """
        if isinstance(given, str):
            return self._named(given.strip())
        if isinstance(given, int) and not isinstance(given, bool) and given in map(self._named, self.names):
            return given
        raise ValueError(f"expected {self.in_words()}, got {shown(given)}")

    def in_words(self) -> str:
        """Return what is expected, for messages."""
        return f"a {self.kind} ({', '.join(self.names)})"

    def _named(self, name: str) -> int:
        if name not in self.names:
            raise ValueError(f"unknown {self.kind} '{name}'{hint(name, self.names)}")
        return int(getattr(pybullet, name))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.parse, handler(source))

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"kind": self.kind, "anyOf": [self._name_schema(), self._number_schema()]}

    def one_or_several_schema(self) -> dict[str, Any]:
        """Returns the JSON Schema of one name, of names as `A|B`, or of one number."""
        several = {"type": "string", "pattern": r"^\s*[A-Z]\w*\s*(\|\s*[A-Z]\w*\s*)+$"}
        return {"kind": self.kind, "anyOf": [self._name_schema(), several, self._number_schema()]}

    def _name_schema(self) -> dict[str, Any]:
        return {"type": "string", "enum": list(self.names)}

    def _number_schema(self) -> dict[str, Any]:
        return {"type": "integer", "enum": sorted(set(map(self._named, self.names)))}


@dataclass(frozen=True)
class Flags(Constants):
    """A family of PyBullet constants that are bits: `A|B`, a list of names and numbers, or one number."""

    def parse(self, given: Any) -> int:
        """Return the numbers of all constants, or-ed.

        Args:
            given: `"A|B"`, a number, or a list of both.

        Raises:
            ValueError: if one of them is not of this family.
        """
        if isinstance(given, str):
            return self._union(self._named(name.strip()) for name in given.split("|"))
        if isinstance(given, (list, tuple)):
            return self._union(map(self.parse, given))
        if isinstance(given, int) and not isinstance(given, bool) and given >= 0:
            return given
        raise ValueError(f"expected {self.in_words()}, got {shown(given)}")

    def in_words(self) -> str:
        """Return what is expected, for messages."""
        return f"{self.kind}s such as {'|'.join(self.names[:2])}"

    @staticmethod
    def _union(values: Iterable[int]) -> int:
        result = 0
        for value in values:
            result |= value
        return result

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        one = self.one_or_several_schema()
        return {"kind": self.kind, "anyOf": [*one["anyOf"], {"type": "array", "items": one}]}

    def _number_schema(self) -> dict[str, Any]:
        return {"type": "integer", "minimum": 0}


def _starting_with(prefix: str) -> tuple[str, ...]:
    return tuple(name for name in dir(pybullet) if name.startswith(prefix))


CONNECTION_MODES = Constants(
    "connection mode",
    (
        *("GUI", "DIRECT", "SHARED_MEMORY", "UDP", "TCP", "GUI_SERVER", "GUI_MAIN_THREAD"),
        *("SHARED_MEMORY_SERVER", "SHARED_MEMORY_GUI"),
        *("GRAPHICS_CLIENT", "GRAPHICS_SERVER", "GRAPHICS_SERVER_TCP", "GRAPHICS_SERVER_MAIN_THREAD"),
    ),
)
SHAPE_TYPES = Constants(
    "shape type",
    (
        *("GEOM_SPHERE", "GEOM_BOX", "GEOM_CAPSULE", "GEOM_CYLINDER"),
        *("GEOM_PLANE", "GEOM_MESH", "GEOM_HEIGHTFIELD"),
    ),
)
CONTROL_MODES = Constants("control mode", ("POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL"))
SOLVER_TYPES = Constants("constraint solver type", _starting_with("CONSTRAINT_SOLVER_LCP_"))
VISUALIZER_FLAGS = Constants("visualizer flag", _starting_with("COV_"))
RESET_FLAGS = Flags("reset flag", _starting_with("RESET_USE_"))
URDF_FLAGS = Flags("URDF flag", _starting_with("URDF_"))
ACTIVATION_STATES = Flags("activation state", _starting_with("ACTIVATION_STATE_"))
JOINT_FEEDBACK_MODES = Flags("joint feedback mode", _starting_with("JOINT_FEEDBACK_"))
VISUAL_SHAPE_FLAGS = Flags("visual shape flag", ("VISUAL_SHAPE_DOUBLE_SIDED",))
COLLISION_SHAPE_FLAGS = Flags("collision shape flag", ("GEOM_FORCE_CONCAVE_TRIMESH", "GEOM_CONCAVE_INTERNAL_EDGE"))
