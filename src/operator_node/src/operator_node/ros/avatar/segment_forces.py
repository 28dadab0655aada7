"""`segment_forces_node.py`: contacts of the avatar in, the force on each segment out."""

import rospy
from geometry_msgs.msg import Vector3

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from operator_node.avatar.parameters import SegmentForcesParameters
from operator_node.msg import SegmentForces
from operator_node.mvn.segments import SEGMENTS
from ros_pybullet_interface.msg import Contacts

QUEUE_SIZE = 100


class SegmentForcesNode:
    """Adds up what each segment of the avatar feels.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        name = private_parameters(SegmentForcesParameters).robot_name
        self._publisher = rospy.Publisher("avatar/segment_forces", SegmentForces, queue_size=QUEUE_SIZE)
        rospy.Subscriber(f"rpbi/{name}/contacts", Contacts, self._take, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _take(self, message: Contacts) -> None:
        forces = {segment: Vector3() for segment in SEGMENTS}
        for point in message.points:
            parts = (
                (point.normal, point.normal_force),
                (point.friction_direction_1, point.friction_force_1),
                (point.friction_direction_2, point.friction_force_2),
            )
            total = forces.get(point.link)
            if total is None:
                continue
            for direction, size in parts:
                total.x += direction.x * size
                total.y += direction.y * size
                total.z += direction.z * size
        self._publisher.publish(SegmentForces(message.header, list(SEGMENTS), list(forces.values())))


def main() -> None:
    """Runs the node."""
    run_node("segment_forces", SegmentForcesNode)
