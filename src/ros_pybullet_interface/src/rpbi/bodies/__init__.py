"""The types of bodies; a new one is a class in a file of its own and a line here."""

from __future__ import annotations

from .body import Body
from .collision import CollisionObject
from .dynamic import DynamicObject
from .mobile_robot import MobileRobot
from .robot import Robot
from .soft import SoftObject
from .urdf_object import UrdfObject
from .visual import VisualObject
from .visual_robot import VisualRobot

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

__all__ = [
    "BODY_TYPES",
    "Body",
    "CollisionObject",
    "DynamicObject",
    "MobileRobot",
    "Robot",
    "SoftObject",
    "UrdfObject",
    "VisualObject",
    "VisualRobot",
]
