"""The types of bodies; to add a type, write a class in its own file and add a line to the table below."""

from custom_ros_tools.plugin_table import PluginTable

from .body import Body
from .body_config import BodyConfig

BODY_TYPES: PluginTable[Body] = PluginTable(
    "object type",
    "rpbi.bodies.body:Body",
    {
        "visual": "rpbi.bodies.visual:VisualObject",
        "collision": "rpbi.bodies.collision:CollisionObject",
        "dynamic": "rpbi.bodies.dynamic:DynamicObject",
        "robot": "rpbi.bodies.robots.robot:Robot",
        "mobile_robot": "rpbi.bodies.robots.mobile_robot:MobileRobot",
        "visual_robot": "rpbi.bodies.robots.visual_robot:VisualRobot",
        "urdf": "rpbi.bodies.urdf_object:UrdfObject",
        "soft": "rpbi.bodies.soft:SoftObject",
    },
    suggests=False,
)
"""Types of bodies in the order of loading: soft bodies come last, since they may be attached to other bodies."""

__all__ = ["BODY_TYPES", "Body", "BodyConfig"]
