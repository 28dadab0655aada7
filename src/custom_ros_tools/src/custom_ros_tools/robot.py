"""Re-exports publishers and subscribers of joint states that use the caller's order of joints."""

from custom_ros_tools.ros.joint_states import (
    JointStatePublisher,
    JointStateSubscriber,
    get_joint_state,
    resolve_joint_order,
)

__all__ = ["JointStatePublisher", "JointStateSubscriber", "get_joint_state", "resolve_joint_order"]
