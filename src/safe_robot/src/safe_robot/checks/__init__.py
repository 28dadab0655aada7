"""The checks; a new one is a class in a file of its own and a line here.

A user's own one needs no line: `"their_package.module:Class"` serves wherever a name does.
"""

CHECKS = {
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
}
"""Class of each check, in the order in which they are made; imported when it is asked for."""
