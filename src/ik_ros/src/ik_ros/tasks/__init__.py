"""What a formulation of the solver `tasks` is made of; a new one is a class in a file of its own and a line here.

A user's own one needs no line: `"their_package.module:Class"` serves wherever a type does.
"""

TASKS: dict[str, str] = {
    "frame_pose": "ik_ros.tasks.frame_pose:FramePose",
    "frame_position": "ik_ros.tasks.frame_position:FramePosition",
    "frame_orientation": "ik_ros.tasks.frame_orientation:FrameOrientation",
    "look_at": "ik_ros.tasks.look_at:LookAt",
    "posture": "ik_ros.tasks.posture:Posture",
    "closeness": "ik_ros.tasks.closeness:Closeness",
    "com": "ik_ros.tasks.com:Com",
    "com_in_support": "ik_ros.tasks.com_in_support:ComInSupport",
    "joint_limits": "ik_ros.tasks.joint_limits:JointLimits",
    "velocity_limits": "ik_ros.tasks.velocity_limits:VelocityLimits",
    "acceleration_limits": "ik_ros.tasks.acceleration_limits:AccelerationLimits",
    "distance": "ik_ros.tasks.distance:Distance",
}
"""Class of each type of task; imported when it is asked for, since they need Pinocchio."""
