"""The table of tasks for the solver `tasks`. To add a task, write a class in a new file, and add it to the table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from custom_ros_tools.plugin_table import PluginTable

if TYPE_CHECKING:
    from .task import Task

TASKS: PluginTable[Task] = PluginTable(
    "task",
    "ik_ros.tasks.task:Task",
    {
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
    },
)
"""All types of tasks, indexed by name. A task's module needs Pinocchio, and is only imported when it is looked up."""
