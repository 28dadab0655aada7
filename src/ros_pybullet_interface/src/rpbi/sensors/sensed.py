"""The parts of the world that sensors read, as protocols: the world and its bodies are built on sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from rpbi.control.external_wrenches import ExternalWrenches
from rpbi.engine.client import Client
from rpbi.engine.clock import Clock
from rpbi.geometry import Pose, Twist
from rpbi.samples import BodyState
from rpbi.urdf.joints import Joint


class SensedBody(Protocol):
    """A `Body`."""

    pb: Client
    name: str
    body_id: int
    root_link: str
    dynamics_changes: int

    @property
    def external_wrenches(self) -> ExternalWrenches:
        """Forces and torques on its links from outside."""

    @property
    def link_indices(self) -> tuple[int, ...]:
        """PyBullet's indices of all links but the root."""

    def link_name(self, index: int) -> str:
        """Returns the name of a link."""

    def dynamics_info(self, link: int) -> tuple[Any, ...]:
        """Returns PyBullet's dynamics of a link."""

    def base_pose(self) -> Pose:
        """Returns the pose of the root link's URDF frame in the world."""

    def base_twist(self) -> Twist:
        """Returns the twist of the root link in the world."""

    def state(self) -> BodyState:
        """Returns all that the renderer needs."""


class SensedRobot(SensedBody, Protocol):
    """A `JointedBody`."""

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints, fixed ones included, in PyBullet's order."""

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motor efforts [N m or N] of all joints by what PyBullet reports."""


class SensedWorld(Protocol):
    """A `World`."""

    pb: Client
    clock: Clock

    @property
    def bodies(self) -> Mapping[str, Any]:
        """All bodies by name."""

    @property
    def cameras(self) -> Mapping[str, Any]:
        """All cameras by name, each an `RgbdSensor`."""

    @property
    def contacts(self) -> Any:
        """Contacts of all bodies, a `ContactReader`."""

    @property
    def attachments(self) -> Any:
        """Bodies that hold others, `Attachments`."""
