"""Joint states with the joints in the order of your own list."""

from custom_ros_tools.ros.joint_states import (
    JointStatePublisher,
    JointStateSubscriber,
    get_joint_state,
    resolve_joint_order,
)

__all__ = ["JointStatePublisher", "JointStateSubscriber", "get_joint_state", "resolve_joint_order"]
