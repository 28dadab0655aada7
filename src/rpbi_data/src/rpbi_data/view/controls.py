"""Interface through which the buttons of a live view control a world."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import Vector

UNLIMITED_RAD, UNLIMITED_M = math.pi, 1.0
"""Half the range of a joint without limits: of a revolute joint [rad], and of another joint [m]."""
MAX_STEPS = 1_000_000
MAX_SIZE_M = 100.0


class JointRange(NamedTuple):
    """Name and limits of a joint [rad or m], and its unit."""

    name: str
    lower: float
    upper: float
    unit: str

    @classmethod
    def of(cls, name: str, lower: float, upper: float, is_revolute: bool) -> JointRange:
        """Returns the range of a joint; a joint without limits gets a range around zero."""
        if not lower < upper or not math.isfinite(upper - lower):
            upper = UNLIMITED_RAD if is_revolute else UNLIMITED_M
            lower = -upper
        return cls(name, lower, upper, "rad" if is_revolute else "m")


class NewObject(NamedTuple):
    """A box, a sphere or a cylinder, which can be added to a world.

    Attributes:
        name: Name of the new object.
        kind: One of `PRIMITIVES`.
        size: Extents along x, y and z [m]. A sphere and the section of a cylinder are as wide as the first one.
        position: Position of the centre in the world frame [m].
        mass_kg: Mass [kg].
    """

    name: str
    kind: str
    size: Vector
    position: Vector
    mass_kg: float

    def config(self) -> dict[str, Any]:
        """Returns the keys of a dynamic object.

        Raises:
            InterfaceError: If a number makes no sense.
        """
        if self.kind not in PRIMITIVES:
            raise InterfaceError(f"expected one of {', '.join(PRIMITIVES)}, got {self.kind!r}")
        if not self.name.strip():
            raise InterfaceError("expected a name of the object")
        if not all(0.0 < each <= MAX_SIZE_M for each in self.size) or not 0.0 < self.mass_kg < math.inf:
            raise InterfaceError(f"expected sizes above 0 and up to {MAX_SIZE_M:g} m, and a mass above 0")
        shape, keys = PRIMITIVES[self.kind]
        return {
            "name": self.name.strip(),
            "createVisualShape": {"shapeType": shape, "rgbaColor": [0.2, 0.5, 0.8, 1.0], **keys(self.size, "length")},
            "createCollisionShape": {"shapeType": shape, **keys(self.size, "height")},
            "baseMass": self.mass_kg,
            "basePosition": list(self.position),
            "broadcast_hz": 50,
        }


def _halves(size: Vector, _: str) -> dict[str, Any]:
    return {"halfExtents": [each / 2 for each in size]}


def _radius(size: Vector, _: str) -> dict[str, Any]:
    return {"radius": size[0] / 2}


def _cylinder(size: Vector, length: str) -> dict[str, Any]:
    return {"radius": size[0] / 2, length: size[2]}


PRIMITIVES: Mapping[str, tuple[str, Callable[[Vector, str], dict[str, Any]]]] = {
    "box": ("GEOM_BOX", _halves),
    "sphere": ("GEOM_SPHERE", _radius),
    "cylinder": ("GEOM_CYLINDER", _cylinder),
}
"""PyBullet's shape of each primitive, and a function that returns its keys. PyBullet calls a height `length`, too."""


class Controls(Protocol):
    """Controls of a running world. Methods return a message, and raise an `InterfaceError` if they fail.

    All methods may be called from any thread. Methods that wait for the world have no effect on other methods.
    """

    @property
    def commands(self) -> Sequence[str]:
        """Names of the commands that `run` accepts now, such as `Start`."""

    @property
    def adds_files(self) -> bool:
        """Whether `add_file` is supported."""

    @property
    def records(self) -> bool:
        """Whether recording is supported."""

    def status(self) -> str:
        """Returns the state of the world in a few words."""

    def run(self, command: str) -> str:
        """Runs a command: `Start`, `Stop`, `Step` or `Reset`."""

    def step(self, ticks: int) -> str:
        """Advances a stopped world by a number of ticks."""

    def factor(self) -> float | None:
        """Returns the requested real-time factor; None if it is not known."""

    def set_factor(self, factor: float) -> str:
        """Changes the real-time factor; 0 is as fast as possible."""

    def robots(self) -> Sequence[str]:
        """Returns the names of all robots."""

    def joints(self, robot: str) -> Sequence[JointRange]:
        """Returns the movable joints of a robot."""

    def positions(self, robot: str) -> Mapping[str, float]:
        """Returns the measured positions of a robot's joints [rad or m], as far as they are known."""

    def move(self, robot: str, positions: Mapping[str, float], duration_s: float) -> str:
        """Moves joints to positions [rad or m] within a duration [s], and waits for the end of the motion."""

    def home(self, robot: str, duration_s: float) -> str:
        """Moves all joints to where they started, and waits for the end of the motion."""

    def halt(self, robot: str) -> str:
        """Ends a motion; the joints hold their positions."""

    def objects(self) -> Sequence[str]:
        """Returns the names of all objects that can be removed."""

    def add(self, primitive: NewObject) -> str:
        """Adds a primitive."""

    def add_file(self, file: str, name: str, position: Vector) -> str:
        """Adds the object of a YAML or URDF file; an empty name stands for the name in the file."""

    def remove(self, name: str) -> str:
        """Removes an object or a camera."""

    def record(self, label: str) -> str:
        """Starts a recording."""

    def end_recording(self) -> str:
        """Ends the recording."""

    def label(self, label: str) -> str:
        """Labels the recording, or the present moment in it."""

    @property
    def is_recording(self) -> bool:
        """Whether a recording runs."""
