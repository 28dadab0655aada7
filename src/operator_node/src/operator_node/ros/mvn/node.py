"""`mvn_node.py`: people whom MVN streams, as TF, poses and a joy message."""

from custom_ros_tools.ros.lifecycle.run_node import run_node
from operator_node.ros.devices.device_node import DeviceNode


def main() -> None:
    """Runs the node."""
    run_node("mvn", lambda: DeviceNode("mvn"), DeviceNode.run)
