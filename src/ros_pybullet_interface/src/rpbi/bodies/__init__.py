"""The types of bodies; a new one is a class in a file of its own and a line here."""

from custom_ros_tools.plugins import ClassTable, find_class

from .body import Body
from .body_config import BodyConfig

BODY_TYPES = ClassTable(
    {
        "visual": "rpbi.bodies.visual:VisualObject",
        "collision": "rpbi.bodies.collision:CollisionObject",
        "dynamic": "rpbi.bodies.dynamic:DynamicObject",
        "robot": "rpbi.bodies.robots.robot:Robot",
        "mobile_robot": "rpbi.bodies.robots.mobile_robot:MobileRobot",
        "visual_robot": "rpbi.bodies.robots.visual_robot:VisualRobot",
        "urdf": "rpbi.bodies.urdf_object:UrdfObject",
        "soft": "rpbi.bodies.soft:SoftObject",
    }
)
"""In the order in which a world loads them; soft bodies may be attached to any of the others."""


def body_class(kind: str) -> type[Body]:
    """Returns the class of bodies of a type, a key of BODY_TYPES or `module:Class` of another package.

    Raises:
        ValueError: If there is none.
    """
    found: type[Body] = BODY_TYPES[kind] if kind in BODY_TYPES else find_class(kind, Body)
    return found


def kind_of(body: Body) -> str:
    """Returns the type of a body, by which `body_class` finds its class."""
    return BODY_TYPES.name_of(type(body))


__all__ = ["BODY_TYPES", "Body", "BodyConfig", "body_class", "kind_of"]
