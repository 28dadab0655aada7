"""The checks; to add one, write a class in its own file and a line here."""

from custom_ros_tools.plugins.table import PluginTable
from safe_robot.check import Check

CHECKS: PluginTable[Check] = PluginTable(
    "check",
    "safe_robot.check:Check",
    {
        "joint_position": "safe_robot.checks.joint_position:JointPosition",
        "joint_velocity": "safe_robot.checks.joint_velocity:JointVelocity",
        "joint_acceleration": "safe_robot.checks.joint_acceleration:JointAcceleration",
        "joint_jerk": "safe_robot.checks.joint_jerk:JointJerk",
        "link_box": "safe_robot.checks.link_box:LinkBox",
        "link_velocity": "safe_robot.checks.link_velocity:LinkVelocity",
        "self_collision": "safe_robot.checks.self_collision:SelfCollision",
        "environment": "safe_robot.checks.environment:Environment",
        "staleness": "safe_robot.checks.staleness:Staleness",
        "tracking": "safe_robot.checks.tracking:Tracking",
        "force": "safe_robot.checks.force:Force",
    },
)
"""All checks, in the order in which a guard makes them."""
