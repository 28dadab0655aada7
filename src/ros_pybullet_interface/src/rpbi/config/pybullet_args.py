"""Parses PyBullet's constants from names or numbers in YAML."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import or_
from typing import Any

import pybullet
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from custom_ros_tools.errors import hint
from custom_ros_tools.schema.type_names import shown, type_name


@dataclass(frozen=True)
class Constants:
    """A family of PyBullet constants of which one is chosen, such as the shape types.

    A field of type `Annotated[int, SHAPE_TYPES]` accepts the name or the number of a constant, and holds the number.

    Attributes:
        kind: Noun for one constant of the family, for messages.
        names: Names of the constants.
        own: Numbers of constants that PyBullet does not define, keyed by name.
    """

    kind: str
    names: tuple[str, ...]
    own: Mapping[str, int] = field(default_factory=dict, hash=False)

    def parse(self, given: Any) -> int:
        """Returns the number of a constant that is given by name or number.

        Raises:
            ValueError: If the name or number does not belong to the family.
        """
        if isinstance(given, str):
            return self._named(given.strip())
        if isinstance(given, int) and not isinstance(given, bool) and given in map(self._named, self.names):
            return given
        raise ValueError(f"expected {type_name(self.schema())}, got {shown(given)}")

    def _named(self, name: str) -> int:
        if name not in self.names:
            raise ValueError(f"unknown {self.kind} '{name}'{hint(name, self.names)}")
        return self.own[name] if name in self.own else int(getattr(pybullet, name))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.parse, handler(source))

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return self.schema()

    def schema(self) -> dict[str, Any]:
        """Returns the JSON Schema of the accepted values."""
        return {"kind": self.kind, "enum": [*self.names, *sorted(set(map(self._named, self.names)))]}

    def one_or_several_schema(self) -> dict[str, Any]:
        """Returns a JSON Schema that accepts one name, names joined as in `A|B`, or one number."""
        several = {"type": "string", "pattern": r"^\s*[A-Z]\w*\s*(\|\s*[A-Z]\w*\s*)+$"}
        return {"kind": self.kind, "anyOf": [{"enum": list(self.names)}, several, {"type": "integer", "minimum": 0}]}


@dataclass(frozen=True)
class Flags(Constants):
    """A family of PyBullet constants that are bit flags, so several constants can be combined."""

    def parse(self, given: Any) -> int:
        """Combines constants with bitwise or, and returns the number.

        Args:
            given: Names as `"A|B"`, a number, or a list of names and numbers.

        Raises:
            ValueError: If a name does not belong to the family, or a number is not in the range from 0 to 2^31 - 1.
        """
        if isinstance(given, str):
            return _union(self._named(name.strip()) for name in given.split("|"))
        if isinstance(given, (list, tuple)):
            return _union(map(self.parse, given))
        if isinstance(given, int) and not isinstance(given, bool) and 0 <= given < 2**31:
            return given
        raise ValueError(f"expected {type_name(self.schema())}, got {shown(given)}")

    def schema(self) -> dict[str, Any]:
        one = self.one_or_several_schema()
        return {**one, "anyOf": [*one["anyOf"], {"type": "array", "items": one}]}


def _union(values: Iterable[int]) -> int:
    return reduce(or_, values, 0)


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
IMPEDANCE_CONTROL = 100
"""Control mode in which springs and dampers hold the joints; PyBullet does not have this mode."""
CONTROL_MODES = Constants(
    "control mode",
    ("POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL", "IMPEDANCE_CONTROL"),
    {"IMPEDANCE_CONTROL": IMPEDANCE_CONTROL},
)
SOLVER_TYPES = Constants("constraint solver type", _starting_with("CONSTRAINT_SOLVER_LCP_"))
VISUALIZER_FLAGS = Constants("visualizer flag", _starting_with("COV_"))
RESET_FLAGS = Flags("reset flag", _starting_with("RESET_USE_"))
URDF_FLAGS = Flags("URDF flag", _starting_with("URDF_"))
ACTIVATION_STATES = Flags("activation state", _starting_with("ACTIVATION_STATE_"))
JOINT_FEEDBACK_MODES = Flags("joint feedback mode", _starting_with("JOINT_FEEDBACK_"))
VISUAL_SHAPE_FLAGS = Flags("visual shape flag", ("VISUAL_SHAPE_DOUBLE_SIDED",))
COLLISION_SHAPE_FLAGS = Flags("collision shape flag", ("GEOM_FORCE_CONCAVE_TRIMESH", "GEOM_CONCAVE_INTERNAL_EDGE"))
