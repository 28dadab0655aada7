"""Joint states with the joints in the order of your own list."""

from .ros.joint_state_publisher import JointStatePublisher
from .ros.joint_state_subscriber import JointStateSubscriber
from .ros.joint_states import get_joint_state, resolve_joint_order

__all__ = ["JointStatePublisher", "JointStateSubscriber", "get_joint_state", "resolve_joint_order"]
