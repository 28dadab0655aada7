"""The types of bodies; a new one is a class in a file of its own and a line here."""

from __future__ import annotations

from custom_ros_tools.plugins import find_class, full_name
from rpbi.bodies.robots.mobile_robot import MobileRobot
from rpbi.bodies.robots.robot import Robot
from rpbi.bodies.robots.visual_robot import VisualRobot

from .body import Body
from .body_config import BodyConfig
from .collision import CollisionObject
from .dynamic import DynamicObject
from .soft import SoftObject
from .urdf_object import UrdfObject
from .visual import VisualObject

BODY_TYPES: dict[str, type[Body]] = {
    "visual": VisualObject,
    "collision": CollisionObject,
    "dynamic": DynamicObject,
    "robot": Robot,
    "mobile_robot": MobileRobot,
    "visual_robot": VisualRobot,
    "urdf": UrdfObject,
    "soft": SoftObject,
}
"""In the order in which a world loads them; soft bodies may be tied to any of the others."""


def body_class(kind: str) -> type[Body]:
    """Returns the class of bodies of a type.

    Args:
        kind: A key of BODY_TYPES, or `module:Class` of another package.

    Raises:
        ValueError: If there is none.
    """
    return BODY_TYPES[kind] if kind in BODY_TYPES else find_class(kind, Body)


def kind_of(body: Body) -> str:
    """Returns the type of a body, by which `body_class` finds its class."""
    return next((kind for kind, each in BODY_TYPES.items() if each is type(body)), full_name(body))


__all__ = [
    "BODY_TYPES",
    "Body",
    "BodyConfig",
    "CollisionObject",
    "DynamicObject",
    "MobileRobot",
    "Robot",
    "SoftObject",
    "UrdfObject",
    "VisualObject",
    "VisualRobot",
    "body_class",
    "kind_of",
]
