"""Re-exports publishers and subscribers of joint states, for joints in an order that the caller chooses."""

from custom_ros_tools.ros.joint_states import (
    JointStatePublisher,
    JointStateSubscriber,
    get_joint_state,
    resolve_joint_order,
)

__all__ = ["JointStatePublisher", "JointStateSubscriber", "get_joint_state", "resolve_joint_order"]
